// A camera that replays an archive's frames in real time, in the manifest's order, and starts over after the
// last. Sequence numbers keep rising.
//
// A run replays the frames of one exposure time; only exposure times in the archive are supported. Exposures
// last as long as recorded. They follow each other at the recorded intervals (a pause of more than a second
// is left out), or at a given rate.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "camera-node/camera.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class ReplayCamera final : public Camera {
 public:
  struct Options {
    std::string name = "camera-1";
    std::filesystem::path archive;
    std::optional<double> frame_rate_hz;  // default: the recorded intervals, or 30 where they are unknown
  };
  // Opens any archive that `import` reads, or one that a camera node is still writing (its present frames).
  // NOT_FOUND or DATA_LOSS name the file. FAILED_PRECONDITION: no frame has an exposure time, or an exposure
  // is longer than the frame interval.
  static absl::StatusOr<std::unique_ptr<ReplayCamera>> open(const Options& options);

  v1::GetCameraResponse describe() const override;
  absl::Status start(double exposure_ms) override;
  std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) override;
  void stop() override;

 private:
  struct Replayed {
    v1::Frame frame;
    nanoseconds length{};    // of its exposure, first row to last
    nanoseconds interval{};  // to the next frame's start
  };
  ReplayCamera(const Options& options, const v1::Camera& camera, std::vector<Replayed> frames);

  const Options options_;
  const v1::Camera camera_;
  const std::vector<Replayed> frames_;
  std::mutex mutex_;
  std::vector<const Replayed*> running_;  // none: stopped; guarded by mutex_
  size_t at_ = 0;                         // the next frame in running_; guarded by mutex_
  nanoseconds next_start_{};              // guarded by mutex_
  std::int64_t sequence_ = 0;             // guarded by mutex_
};

}  // namespace glasswing
