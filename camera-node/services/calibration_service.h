// CalibrationService: fits camera and display calibrations to this node's archives of method "calibration".
#pragma once

#include "core/archive/archive_store.h"
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
};

}  // namespace glasswing
