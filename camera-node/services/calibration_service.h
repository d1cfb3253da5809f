// CalibrationService: fits camera and display calibrations to this node's archives of method "calibration".
#pragma once

#include "core/archive/archive_store.h"
#include "core/service/joined_calls.h"
#include "glasswing/v1/calibration_service.grpc.pb.h"

namespace glasswing {

class CalibrationServiceImpl final : public v1::CalibrationService::Service {
 public:
  explicit CalibrationServiceImpl(ArchiveStore& store) : store_(store) {}
  grpc::Status FitCamera(grpc::ServerContext*, const v1::FitCameraRequest*, v1::FitCameraResponse*) override;
  grpc::Status FitDisplays(grpc::ServerContext*, const v1::FitDisplaysRequest*,
                           v1::FitDisplaysResponse*) override;

 private:
  ArchiveStore& store_;
  JoinedCalls<v1::FitCameraResponse> camera_fits_{0};     // by session
  JoinedCalls<v1::FitDisplaysResponse> display_fits_{0};  // by session
};

}  // namespace glasswing
