#include "solver/worker/video_solve.h"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <map>
#include <mutex>

#include "core/base/status.h"
#include "core/image/mosaic.h"
#include "solver/method/linear_stack.h"
#include "solver/ramp/video_layout.h"

namespace glasswing {
namespace {

constexpr size_t kAhead = 3;  // frames in memory before they are requested

class ReadAhead final : public VideoSource {
 public:
  ReadAhead(const v1::CaptureManifest& manifest, LinearStack linear, const VideoLayout& layout, int first,
            int count, ReadFrame read)
      : manifest_(linear.manifest_of_light(manifest)),
        linear_(std::move(linear)),
        read_(std::move(read)),
        order_(layout.empty) {
    order_.insert(order_.end(), layout.black.begin(), layout.black.end());
    const int size = static_cast<int>(layout.frames.size());
    for (int i = 0; i < size; ++i) {
      const int place = layout.frames[i];
      if (place < 0) continue;
      number_[place] = i;
      if (i >= first && i < first + count) order_.push_back(place);
    }
  }

  const v1::CaptureManifest& manifest() const override { return manifest_; }

  absl::StatusOr<VideoFrame> read(int frame) override {
    std::future<absl::StatusOr<VideoFrame>> wanted;
    {
      const std::lock_guard lock(mutex_);
      start(frame);
      wanted = std::move(coming_.at(frame));
      coming_.erase(frame);
      auto next = std::ranges::find(order_, frame);
      if (next != order_.end()) ++next;
      for (; next != order_.end() && coming_.size() < kAhead; ++next) start(*next);
    }
    return wanted.get();
  }

 private:
  void start(int frame) {
    if (!coming_.contains(frame))
      coming_[frame] = std::async(std::launch::async, [this, frame] { return light_of(frame); });
  }

  absl::StatusOr<VideoFrame> light_of(int frame) const {
    absl::StatusOr<std::vector<std::uint16_t>> read = read_(frame);
    if (!read.ok()) {
      const auto number = number_.find(frame);
      return number == number_.end() ? read.status() : in_frame(number->second, read.status());
    }
    const int width = manifest_.camera().width_px(), height = manifest_.camera().height_px();
    if (const std::optional<Mosaic> mosaic = mosaic_of(manifest_.camera()); mosaic && read.ok()) {
      // A video's colours tell places, so each pixel needs all of them.
      Image16 stored(width, height, 1);
      stored.samples = *std::move(read);
      read = interpolated(stored, mosaic).samples;
    }
    const auto codes = std::make_shared<const std::vector<std::uint16_t>>(*std::move(read));
    const FrameStack stack =
        linear_.of({.width_px = width, .row_count = height, .rows = {*codes}, .owner = codes});
    return VideoFrame{.view = {.width_px = width,
                               .height_px = height,
                               .samples = stack.rows.front(),
                               .zero = stack.zero,
                               .unit = stack.unit},
                      .owner = stack.owner};
  }

  const v1::CaptureManifest manifest_;  // of light
  const LinearStack linear_;
  const ReadFrame read_;
  std::vector<int> order_;     // of frames, as the method will request them
  std::map<int, int> number_;  // in the video, by index in manifest.frames
  std::mutex mutex_;
  std::map<int, std::future<absl::StatusOr<VideoFrame>>> coming_;  // guarded by mutex_
};

}  // namespace

absl::StatusOr<std::unique_ptr<VideoSource>> read_ahead(const v1::CaptureManifest& manifest, int first,
                                                        int count, ReadFrame read) {
  GW_ASSIGN_OR_RETURN(LinearStack linear, LinearStack::create(manifest));
  GW_ASSIGN_OR_RETURN(const VideoLayout layout, lay_out_video(manifest));
  return std::make_unique<ReadAhead>(manifest, std::move(linear), layout, first, count, std::move(read));
}

absl::Status solve_video(const VideoMethod& method, VideoSource& source, int first, int count,
                         int thread_count, std::stop_token stop, const FrameDone& done) {
  GW_ASSIGN_OR_RETURN(const LinearStack linear, LinearStack::create(source.manifest()));
  return method.solve(source, first, count, thread_count, stop, [&](int frame, absl::StatusOr<Matte> matte) {
    if (matte.ok()) linear.describe(matte->metadata);
    return done(frame, std::move(matte));
  });
}

}  // namespace glasswing
