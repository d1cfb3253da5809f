// Shows the colour ramp of live mattes on one monitor, without an id patch, until the object is destroyed.
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
  // Returns when the ramp is on screen and a motorised stage has taken the object away. INVALID_ARGUMENT: no
  // such monitor. FAILED_PRECONDITION: no solver offers live mattes, several cameras are up and the request
  // names none, or a calibration is for other settings. UNAVAILABLE: a node does not answer. CANCELLED:
  // stopped.
  static absl::StatusOr<std::unique_ptr<RampShow>> start(const NodeRegistry& rig,
                                                         const CalibrationStore& calibrations,
                                                         const v1::ShowRampRequest& request,
                                                         std::stop_token stop);

  // The nodes that take part, and whether a person has to place or remove the object, as last requested.
  const v1::ShowRampResponse& description() const { return description_; }
  absl::Status move_object(bool present);
  // OK while the ramp is on screen.
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
