#include "server/rig/stage_axes.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/service/service.h"
#include "glasswing/v1/axis_service.grpc.pb.h"

namespace glasswing {

absl::Status check_axes(NodeLink& camera, const AxisPositions& positions) {
  if (positions.empty()) return absl::OkStatus();
  v1::GetAxesResponse stage;
  const auto stub = v1::AxisService::NewStub(camera.channel());
  const absl::Status known = camera.call("describe its stage", {}, [&](grpc::ClientContext& context) {
    return stub->GetAxes(&context, {}, &stage);
  });
  if (!absl::IsUnimplemented(known)) GW_RETURN_IF_ERROR(known);
  for (const auto& [name, position] : positions) {
    const auto axis = std::ranges::find(stage.axes(), name, &v1::Axis::name);
    if (axis == stage.axes().end()) {
      std::string names;
      for (const v1::Axis& each : stage.axes()) names += (names.empty() ? "" : ", ") + each.name();
      return absl::InvalidArgumentError(fmt::format(
          "the stage of the {} has no axis \"{}\"; {}", camera.title(), name,
          names.empty() ? "glasswing-camera --axis turn=0:360 gives it one" : "it has: " + names));
    }
    if (position >= axis->min() && position <= axis->max()) continue;
    return absl::InvalidArgumentError(fmt::format("axis \"{}\" shall move to {} {}; it takes {} to {}", name,
                                                  position, axis->unit(), axis->min(), axis->max()));
  }
  return absl::OkStatus();
}

absl::StatusOr<v1::MoveAxesResponse> move_axes(NodeLink& camera, v1::MoveAxesRequest request,
                                               std::stop_token stop) {
  request.set_request_id(random_token());
  const auto stub = v1::AxisService::NewStub(camera.channel());
  // Where it fails, the move ends by itself.
  const std::stop_callback on_stop(stop, [&] { (void)stop_axes(camera); });
  v1::MoveAxesResponse response;
  const absl::Status moved = camera.call("move its stage", {}, [&](grpc::ClientContext& context) {
    return stub->MoveAxes(&context, request, &response);
  });
  if (!moved.ok() && stop.stop_requested()) return absl::CancelledError("stopped");
  GW_RETURN_IF_ERROR(moved);
  return response;
}

absl::Status stop_axes(const NodeLink& camera) {
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  v1::StopAxesResponse response;
  return from_grpc(v1::AxisService::NewStub(camera.channel())->StopAxes(&context, {}, &response),
                   camera.title());
}

}  // namespace glasswing
