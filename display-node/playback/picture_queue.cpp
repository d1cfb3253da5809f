#include "display-node/playback/picture_queue.h"

#include <algorithm>

namespace glasswing {

PictureQueue::PictureQueue(const Program& program, unsigned threads)
    : program_(program),
      ahead_(std::max(size_t{2}, std::min(size_t{2} * threads, kAheadBytes / program.bytes_of_pictures()))) {
  for (size_t i = 0; i < std::min(ahead_, size_t{std::max(threads, 1u)}); ++i)
    threads_.emplace_back([this] { draw(); });
}

PictureQueue::~PictureQueue() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
}

std::vector<Picture> PictureQueue::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return waiting_.contains(taken_); });
  std::vector<Picture> pictures = std::move(waiting_.extract(taken_).mapped());
  ++taken_;
  changed_.notify_all();
  return pictures;
}

void PictureQueue::draw() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || drawn_ < std::min(program_.size(), taken_ + ahead_); });
    if (stopping_) return;
    const size_t step = drawn_++;
    lock.unlock();
    std::vector<Picture> pictures = program_.pictures(step);
    lock.lock();
    waiting_[step] = std::move(pictures);
    changed_.notify_all();
  }
}

}  // namespace glasswing
