// RigService: holds of the rig, and measurements, one at a time, streamed to the caller.
#pragma once

#include <atomic>
#include <map>
#include <mutex>
#include <string>

#include "glasswing/v1/rig_service.grpc.pb.h"
#include "server/services/server.h"

namespace glasswing {

class RigServiceImpl final : public v1::RigService::Service {
 public:
  explicit RigServiceImpl(Server& server) : server_(server) {}
  // Ends a running measurement and a hold, so that the daemon can stop.
  void stop() { stopping_ = true; }

  grpc::Status CalibrateSync(grpc::ServerContext*, const v1::CalibrateSyncRequest*,
                             grpc::ServerWriter<v1::CalibrateSyncResponse>*) override;
  grpc::Status CheckRig(grpc::ServerContext*, const v1::CheckRigRequest*,
                        grpc::ServerWriter<v1::CheckRigResponse>*) override;
  grpc::Status FitCalibration(grpc::ServerContext*, const v1::FitCalibrationRequest*,
                              v1::FitCalibrationResponse*) override;
  grpc::Status ListCalibrations(grpc::ServerContext*, const v1::ListCalibrationsRequest*,
                                v1::ListCalibrationsResponse*) override;
  grpc::Status ForgetCalibration(grpc::ServerContext*, const v1::ForgetCalibrationRequest*,
                                 v1::ForgetCalibrationResponse*) override;
  using RampStream = grpc::ServerReaderWriter<v1::ShowRampResponse, v1::ShowRampRequest>;
  grpc::Status ShowRamp(grpc::ServerContext*, RampStream*) override;
  grpc::Status ShowPattern(grpc::ServerContext*, const v1::ShowPatternRequest*,
                           grpc::ServerWriter<v1::ShowPatternResponse>*) override;
  grpc::Status HoldRig(grpc::ServerContext*, const v1::HoldRigRequest*,
                       grpc::ServerWriter<v1::HoldRigResponse>*) override;
  grpc::Status MakePlan(grpc::ServerContext*, const v1::MakePlanRequest*, v1::MakePlanResponse*) override;
  grpc::Status ReleaseRig(grpc::ServerContext*, const v1::ReleaseRigRequest*,
                          v1::ReleaseRigResponse*) override;
  grpc::Status PlaceMonitor(grpc::ServerContext*, const v1::PlaceMonitorRequest*,
                            v1::PlaceMonitorResponse*) override;
  grpc::Status PlaceObject(grpc::ServerContext*, const v1::PlaceObjectRequest*,
                           v1::PlaceObjectResponse*) override;
  grpc::Status StopObject(grpc::ServerContext*, const v1::StopObjectRequest*,
                          v1::StopObjectResponse*) override;

 private:
  // Drives the rig with `work` while the call is open; stops it when the caller leaves or the daemon stops.
  grpc::Status run(grpc::ServerContext* context, const std::string& what,
                   const std::function<absl::Status(std::stop_token)>& work);

  absl::StatusOr<v1::FitCalibrationResponse> fit_once(const std::string& session);

  Server& server_;
  std::atomic<bool> stopping_ = false;
  std::mutex mutex_;
  std::map<std::string, std::string> fits_;  // when each running one began, by session; guarded by mutex_
};

}  // namespace glasswing
