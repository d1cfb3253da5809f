#include "camera-node/services/axis_service.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "core/process/pause.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr size_t kStoppedKept = 64;

}  // namespace

void AxisServiceImpl::stop() {
  const std::lock_guard lock(mutex_);
  stop_.request_stop();
}

grpc::Status AxisServiceImpl::GetAxes(grpc::ServerContext*, const v1::GetAxesRequest*,
                                      v1::GetAxesResponse* response) {
  *response->mutable_axes() = axes();
  return grpc::Status::OK;
}

grpc::Status AxisServiceImpl::MoveAxes(grpc::ServerContext* context, const v1::MoveAxesRequest* request,
                                       v1::MoveAxesResponse* response) {
  GW_CHECK_LIMITS(*request);
  const auto work = [&]() -> absl::StatusOr<v1::MoveAxesResponse> {
    const std::string& id = request->request_id();
    std::stop_token stop;
    {
      const std::lock_guard lock(mutex_);
      if (!id.empty() && std::ranges::count(stopped_, id) > 0)
        return absl::FailedPreconditionError("the stage was stopped; this move has ended");
      stop = stop_.get_token();
    }
    const std::lock_guard moving(moving_);
    absl::StatusOr<v1::MoveAxesResponse> moved =
        stop.stop_requested() ? absl::FailedPreconditionError("the stage was stopped before it moved")
                              : move(*request, stop);
    if (moved.ok() || !stop.stop_requested() || id.empty()) return moved;
    const std::lock_guard lock(mutex_);
    stopped_.push_back(id);
    if (stopped_.size() > kStoppedKept) stopped_.pop_front();
    return moved;
  };
  return answer(moves_.run(*context, request->request_id(), work), *response);
}

grpc::Status AxisServiceImpl::StopAxes(grpc::ServerContext*, const v1::StopAxesRequest*,
                                       v1::StopAxesResponse*) {
  const std::lock_guard lock(mutex_);
  stop_.request_stop();
  stop_ = std::stop_source();
  return grpc::Status::OK;
}

absl::StatusOr<v1::MoveAxesResponse> AxisServiceImpl::move(const v1::MoveAxesRequest& request,
                                                           std::stop_token stop) {
  GW_RETURN_IF_ERROR(check(request));
  fault_point("axes move");
  const bool moves = !request.home().empty() || !request.positions().empty();
  const google::protobuf::RepeatedPtrField<v1::Axis> before = axes();
  for (const std::string& name : request.home()) {
    GW_ASSIGN_OR_RETURN(const int axis, index_of(name));
    GW_RETURN_IF_ERROR(home(axis, stop));
  }
  for (const StageAxis& axis : device_.axes) {
    const auto wanted = request.positions().find(axis.name);
    if (wanted == request.positions().end()) continue;
    GW_ASSIGN_OR_RETURN(const int index, index_of(axis.name));
    GW_RETURN_IF_ERROR(move_to(index, wanted->second, stop));
  }
  v1::MoveAxesResponse response;
  *response.mutable_axes() = axes();
  const bool rested = std::ranges::equal(before, response.axes(), [](const v1::Axis& a, const v1::Axis& b) {
    return a.has_position() && b.has_position() && a.position() == b.position();
  });
  if (moves && (!rested || !request.home().empty()) &&
      !pause(stop, std::chrono::milliseconds(device_.settle_ms)))
    return absl::FailedPreconditionError("the stage was stopped before it had settled");
  return response;
}

absl::StatusOr<int> AxisServiceImpl::index_of(const std::string& axis) const {
  const auto found = std::ranges::find(device_.axes, axis, &StageAxis::name);
  if (found != device_.axes.end()) return static_cast<int>(found - device_.axes.begin());
  if (device_.axes.empty()) {
    return absl::InvalidArgumentError(fmt::format(
        "the stage has no axis \"{}\", nor any other; glasswing-camera --axis {}=0:360 gives it one", axis,
        axis));
  }
  std::vector<std::string> names;
  for (const StageAxis& each : device_.axes) names.push_back(each.name);
  return absl::InvalidArgumentError(
      fmt::format("the stage has no axis \"{}\"; it has: {}", axis, fmt::join(names, ", ")));
}

absl::Status AxisServiceImpl::check(const v1::MoveAxesRequest& request) const {
  for (const std::string& name : request.home()) {
    GW_RETURN_IF_ERROR(index_of(name).status());
    if (!device_.drive->homes()) {
      return absl::FailedPreconditionError(fmt::format(
          "axis \"{}\" cannot be homed; glasswing-camera --axis-home-command names a program that does it",
          name));
    }
  }
  for (const auto& [name, position] : request.positions()) {
    GW_ASSIGN_OR_RETURN(const int index, index_of(name));
    const StageAxis& axis = device_.axes[index];
    if (position >= axis.min && position <= axis.max) continue;
    return absl::InvalidArgumentError(fmt::format("axis \"{}\" shall move to {} {}; it takes {} to {}", name,
                                                  position, axis.unit(), axis.min, axis.max));
  }
  return absl::OkStatus();
}

absl::Status AxisServiceImpl::home(int axis, std::stop_token stop) {
  const StageAxis& moved = device_.axes[axis];
  note(axis, std::nullopt);
  absl::Status homed = device_.drive->home(moved, stop);
  for (const double to : {-device_.takeup, 0.0})
    if (homed.ok() && device_.takeup > 0.0) homed = device_.drive->move(moved, to, stop);
  spdlog::info("homed axis={} end=\"{}\"", moved.name, homed.ToString());
  if (absl::IsCancelled(homed))
    return absl::FailedPreconditionError(fmt::format("axis \"{}\" was stopped as it was homed", moved.name));
  GW_RETURN_IF_ERROR(homed);
  note(axis, 0.0);
  return absl::OkStatus();
}

absl::Status AxisServiceImpl::move_to(int axis, double position, std::stop_token stop) {
  const StageAxis& moved = device_.axes[axis];
  if (!this->position(axis) && device_.homes_first && device_.drive->homes())
    GW_RETURN_IF_ERROR(home(axis, stop));
  const std::optional<double> from = this->position(axis);
  if (from == position) return absl::OkStatus();
  note(axis, std::nullopt);
  absl::Status done;
  if (device_.takeup > 0.0 && (!from || *from > position))
    done = device_.drive->move(moved, position - device_.takeup, stop);
  if (done.ok()) done = device_.drive->move(moved, position, stop);
  spdlog::info("moved axis={} position={} end=\"{}\"", moved.name, position, done.ToString());
  if (absl::IsCancelled(done)) {
    return absl::FailedPreconditionError(
        fmt::format("axis \"{}\" was stopped on its way to {} {}", moved.name, position, moved.unit()));
  }
  GW_RETURN_IF_ERROR(done);
  note(axis, position);
  return absl::OkStatus();
}

std::optional<double> AxisServiceImpl::position(int axis) const {
  const std::lock_guard lock(mutex_);
  return positions_[axis];
}

void AxisServiceImpl::note(int axis, std::optional<double> position) {
  const std::lock_guard lock(mutex_);
  positions_[axis] = position;
}

google::protobuf::RepeatedPtrField<v1::Axis> AxisServiceImpl::axes() const {
  google::protobuf::RepeatedPtrField<v1::Axis> axes;
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < positions_.size(); ++i) {
    v1::Axis& axis = *axes.Add();
    axis.set_name(device_.axes[i].name);
    axis.set_unit(device_.axes[i].unit());
    axis.set_min(device_.axes[i].min);
    axis.set_max(device_.axes[i].max);
    if (positions_[i]) axis.set_position(*positions_[i]);
    axis.set_homes(device_.drive->homes());
  }
  return axes;
}

}  // namespace glasswing
