#include "server/selftest/ramp_show.h"

#include <fmt/format.h>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/service/monitor.h"
#include "core/service/service.h"
#include "server/rig/embed_calibrations.h"

namespace glasswing {
namespace {

absl::StatusOr<std::string> solver_address(const NodeRegistry& rig) {
  for (const v1::Node& node : rig.up(v1::NODE_KIND_SOLVER)) {
    if (!node.address().empty()) return node.address();
  }
  return absl::FailedPreconditionError(
      "no solver offers live mattes; start one that does: glasswing-solver --listen 127.0.0.1:0");
}

}  // namespace

absl::StatusOr<std::unique_ptr<RampShow>> RampShow::start(const NodeRegistry& rig,
                                                          const CalibrationStore& calibrations,
                                                          const v1::ShowRampRequest& request,
                                                          std::stop_token stop) {
  std::unique_ptr<RampShow> show(new RampShow);
  GW_ASSIGN_OR_RETURN(show->rig_,
                      connect(rig, calibrations, request.camera(),
                              request.monitor().empty() ? MonitorNames() : MonitorNames{request.monitor()}));
  GW_RETURN_IF_ERROR(show->find_monitor(request.monitor()));
  v1::ShowRampResponse& described = show->description_;
  GW_ASSIGN_OR_RETURN(*described.mutable_solver_address(), solver_address(rig));
  described.set_camera_address(show->rig_.camera->address());
  *show->header_.mutable_camera() = show->rig_.camera_info.camera();
  *show->header_.add_monitors() = described.monitor();
  GW_RETURN_IF_ERROR(embed_calibrations(calibrations, show->header_));
  if (show->header_.has_camera_calibration())
    *described.mutable_camera_calibration() = show->header_.camera_calibration();
  show->stage_ = v1::StageService::NewStub(show->rig_.camera->channel());
  GW_RETURN_IF_ERROR(show->move_object(false));
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Stimulus> ramp, test_pattern("ramp", {described.monitor()}));
  GW_ASSIGN_OR_RETURN(show->showing_,
                      StaticPattern::start(show->rig_, ramp, show->header_.display_calibrations(), stop));
  return show;
}

absl::Status RampShow::find_monitor(const std::string& name) {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Monitor> monitors, rig_.monitors());
  if (name.empty() && monitors.size() > 1)
    return absl::InvalidArgumentError("the rig has several monitors; name one of: " + names_of(monitors));
  const std::string& wanted = name.empty() ? monitors.front().name() : name;
  for (const auto& display : rig_.displays) {
    const v1::DisplayMonitor* const monitor = display->monitor(wanted);
    if (monitor == nullptr) continue;
    *description_.mutable_monitor() = listed_monitor(*monitor);
    return absl::OkStatus();
  }
  return no_monitor(wanted, monitors);
}

absl::Status RampShow::move_object(bool present) {
  v1::MoveObjectRequest request;
  request.set_present(present);
  request.set_request_id(random_token());
  v1::MoveObjectResponse response;
  GW_RETURN_IF_ERROR(rig_.camera->call("move the object", {}, [&](grpc::ClientContext& context) {
    return stage_->MoveObject(&context, request, &response);
  }));
  description_.set_needs_operator(response.needs_operator());
  return absl::OkStatus();
}

}  // namespace glasswing
