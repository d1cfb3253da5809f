// Draws a program's pictures ahead of its player, on all cores.
#pragma once

#include <condition_variable>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

#include "display-node/playback/program.h"

namespace glasswing {

class PictureQueue {
 public:
  // `program` must outlive it. Two steps per thread are drawn before they are taken, as far as they fit in
  // kAheadBytes, but at least two.
  explicit PictureQueue(const Program& program, unsigned threads = std::thread::hardware_concurrency());
  ~PictureQueue();

  // The pictures of the next step, from the first on: one for each screen, null is black. Waits until they
  // are drawn. Call it at most program.size() times.
  std::vector<Picture> next();

 private:
  void draw();

  const Program& program_;
  const size_t ahead_;  // steps
  std::mutex mutex_;
  std::condition_variable changed_;
  size_t drawn_ = 0, taken_ = 0;                    // steps begun and taken; guarded by mutex_, as the rest
  std::map<size_t, std::vector<Picture>> waiting_;  // by step
  bool stopping_ = false;
  std::vector<std::jthread> threads_;
};

}  // namespace glasswing
