// The colour ramp on one monitor, without an id patch, for as long as this lives: what live mattes are made
// from.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <stop_token>
#include <string>

#include "glasswing/v1/rig_service.pb.h"
#include "glasswing/v1/stage_service.grpc.pb.h"
#include "server/rig/static_pattern.h"

namespace glasswing {

class RampShow {
 public:
  // Returns when the ramp is there and the object, where a motor moves it, is not. `monitor` empty: the rig's
  // only one. INVALID_ARGUMENT: no such monitor. FAILED_PRECONDITION: no solver offers live mattes, or a
  // calibration is of other settings. UNAVAILABLE: a node is away. CANCELLED: stopped.
  static absl::StatusOr<std::unique_ptr<RampShow>> start(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                                         const std::string& monitor, std::stop_token stop);

  // Who takes part, and whether a person has to bring the object to where it was last wanted, or take it
  // away.
  const v1::ShowRampResponse& description() const { return description_; }
  absl::Status move_object(bool present);
  // Whether the ramp is still there.
  absl::Status check() const { return showing_->check(); }

 private:
  RampShow() = default;
  absl::Status find_monitor(const std::string& name);

  RigLinks rig_;
  v1::CaptureManifest header_;  // with the calibrations in use
  v1::ShowRampResponse description_;
  std::unique_ptr<v1::StageService::Stub> stage_;
  std::unique_ptr<StaticPattern> showing_;
};

}  // namespace glasswing
