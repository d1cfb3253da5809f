// A camera that shows an archive's frames again, in real time and for ever: in the order in which they are
// listed, from the first when the last is over, under numbers that go on rising.
//
// The frames of one exposure time run at a time, and no other can be asked for. Exposures are as long as they
// were; they follow each other as they did (a pause of more than a second is left out), or at a given rate.
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
    std::optional<double> frame_rate_hz;  // else the archive's own, or 30 where it does not say
  };
  // Any archive that `import` reads, or one that a camera node is writing: the frames that it holds now.
  // NOT_FOUND or DATA_LOSS name the file. FAILED_PRECONDITION: it holds no frame with an exposure time, or
  // they do not fit into the rate.
  static absl::StatusOr<std::unique_ptr<ReplayCamera>> open(const Options& options);

  v1::GetCameraResponse describe() const override;
  absl::Status start(double exposure_ms) override;
  std::optional<CapturedFrame> next(std::chrono::milliseconds timeout) override;
  void stop() override;

 private:
  struct Replayed {
    v1::Frame frame;
    nanoseconds length{};    // of its exposure, first row to last
    nanoseconds interval{};  // to the next one's start
  };
  ReplayCamera(const Options& options, const v1::Camera& camera, std::vector<Replayed> frames);

  const Options options_;
  const v1::Camera camera_;
  const std::vector<Replayed> frames_;
  std::mutex mutex_;
  std::vector<const Replayed*> running_;  // none: stopped; guarded by mutex_
  size_t at_ = 0;                         // of running_; guarded by mutex_
  nanoseconds next_start_{};              // guarded by mutex_
  std::int64_t sequence_ = 0;             // guarded by mutex_
};

}  // namespace glasswing
