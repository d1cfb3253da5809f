// Live mattes: method "ramp" without looking ahead.
#pragma once

#include <absl/status/statusor.h>

#include <deque>
#include <memory>
#include <span>

#include "glasswing/v1/live_service.pb.h"
#include "solver/live/camera_stream.h"
#include "solver/method/linear_stack.h"
#include "solver/ramp/ramp_extractor.h"
#include "solver/ramp/smoother/ramp_smoother.h"

namespace glasswing {

class LiveMatte {
 public:
  // `empties`: frames without the object. INVALID_ARGUMENT: an option or a calibration. FAILED_PRECONDITION
  // says what is wrong with the empty stage.
  static absl::StatusOr<LiveMatte> create(const v1::LiveStart& start, const v1::Camera& camera,
                                          std::span<const StreamedFrame> empties, int thread_count);
  // Checks the options before the camera runs. INVALID_ARGUMENT: see create().
  static absl::Status check_options(const v1::LiveStart& start);

  // The matte of the empty stage.
  const Matte& empty_stage() const { return empty_stage_; }
  // Extracts a frame, smooths it with earlier frames and finishes it. Errors: those of
  // RampExtractor::extract.
  absl::StatusOr<RampFrame> next(const StreamedFrame& frame);

 private:
  struct Seen {
    RampFrame raw;
    SmoothInput input;
  };
  LiveMatte(LinearStack light, RampExtractor extractor, RampSmoother smoother, Matte empty_stage,
            int thread_count)
      : light_(std::move(light)),
        extractor_(std::move(extractor)),
        smoother_(std::move(smoother)),
        empty_stage_(std::move(empty_stage)),
        thread_count_(thread_count) {}

  LinearStack light_;
  RampExtractor extractor_;
  RampSmoother smoother_;
  Matte empty_stage_;
  int thread_count_;
  std::deque<std::unique_ptr<Seen>> before_;
  RampFrame spent_;  // reused for the memory of the next frame
};

}  // namespace glasswing
