// A picture that stands on monitors for as long as this lives.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "glasswing/v1/stimulus.pb.h"
#include "server/rig/node_streams.h"

namespace glasswing {

class StaticPattern {
 public:
  // Returns when it is there; other monitors are black. `calibrations`: of those monitors that have one.
  // `rig` must outlive it. CANCELLED: stopped. UNAVAILABLE: a node is away.
  static absl::StatusOr<std::unique_ptr<StaticPattern>> start(
      const RigLinks& rig, const std::vector<v1::Stimulus>& stimuli,
      const google::protobuf::RepeatedPtrField<v1::DisplayCalibration>& calibrations, std::stop_token stop);

  // Whether it is still there.
  absl::Status check() const;

 private:
  StaticPattern() = default;
  // The latest moment until which the display's monitors follow, once it is told to begin at `start`.
  static nanoseconds there_at(const DisplayLink& display, nanoseconds start);

  std::vector<std::unique_ptr<DisplayStream>> playing_;
};

// A picture to frame, focus and look for faults by, on each of `monitors`: "white", "gray" (a fifth of the
// light), "bars" (upright ones), "ramp" or "black". INVALID_ARGUMENT: another one.
absl::StatusOr<std::vector<v1::Stimulus>> test_pattern(const std::string& name,
                                                       const std::vector<v1::Monitor>& monitors);

}  // namespace glasswing
