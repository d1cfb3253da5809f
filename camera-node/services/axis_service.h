// AxisService over a StageDevice: limits, homing, settling, and the stop.
#pragma once

#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "camera-node/stage_drive.h"
#include "core/service/joined_calls.h"
#include "glasswing/v1/axis_service.grpc.pb.h"

namespace glasswing {

class AxisServiceImpl final : public v1::AxisService::Service {
 public:
  explicit AxisServiceImpl(StageDevice device)
      : device_(std::move(device)), positions_(device_.axes.size()) {}
  // Ends moves, so that the daemon can stop.
  void stop();

  grpc::Status GetAxes(grpc::ServerContext*, const v1::GetAxesRequest*, v1::GetAxesResponse*) override;
  grpc::Status MoveAxes(grpc::ServerContext*, const v1::MoveAxesRequest*, v1::MoveAxesResponse*) override;
  grpc::Status StopAxes(grpc::ServerContext*, const v1::StopAxesRequest*, v1::StopAxesResponse*) override;

 private:
  absl::StatusOr<v1::MoveAxesResponse> move(const v1::MoveAxesRequest& request, std::stop_token stop);
  absl::StatusOr<int> index_of(const std::string& axis) const;
  absl::Status check(const v1::MoveAxesRequest& request) const;
  absl::Status home(int axis, std::stop_token stop);
  absl::Status move_to(int axis, double position, std::stop_token stop);
  std::optional<double> position(int axis) const;
  void note(int axis, std::optional<double> position);
  google::protobuf::RepeatedPtrField<v1::Axis> axes() const;

  const StageDevice device_;
  std::mutex moving_;
  mutable std::mutex mutex_;
  std::vector<std::optional<double>> positions_;  // empty: unknown; guarded by mutex_
  std::stop_source stop_;                         // of all calls until now; guarded by mutex_
  std::deque<std::string> stopped_;  // their request ids: a repetition must not move; guarded by mutex_
  JoinedCalls<v1::MoveAxesResponse> moves_;
};

}  // namespace glasswing
