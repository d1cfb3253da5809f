#include "camera-node/services/calibration_service.h"

#include "core/base/status.h"
#include "core/calibration/camera_calibration.h"
#include "core/calibration/display_calibration.h"
#include "core/import/mapped_archive.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

absl::StatusOr<std::shared_ptr<const MappedArchive>> map(ArchiveStore& store, const std::string& session) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store.find(session));
  return MappedArchive::open_interpolated(archive->directory());
}

absl::StatusOr<v1::CameraCalibration> fit_camera(ArchiveStore& store, const std::string& session) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedArchive> archive, map(store, session));
  return calibrate_camera(*archive);
}

absl::StatusOr<DisplayCalibrations> fit_displays(ArchiveStore& store, const std::string& session) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedArchive> archive, map(store, session));
  return calibrate_displays(*archive);
}

}  // namespace

grpc::Status CalibrationServiceImpl::FitCamera(grpc::ServerContext*, const v1::FitCameraRequest* request,
                                               v1::FitCameraResponse* response) {
  absl::StatusOr<v1::CameraCalibration> fitted = fit_camera(store_, request->session());
  if (!fitted.ok()) return to_grpc(fitted.status());
  *response->mutable_calibration() = *std::move(fitted);
  return grpc::Status::OK;
}

grpc::Status CalibrationServiceImpl::FitDisplays(grpc::ServerContext*, const v1::FitDisplaysRequest* request,
                                                 v1::FitDisplaysResponse* response) {
  absl::StatusOr<DisplayCalibrations> fitted = fit_displays(store_, request->session());
  if (!fitted.ok()) return to_grpc(fitted.status());
  for (v1::DisplayCalibration& display : fitted->measured) *response->add_calibrations() = std::move(display);
  for (std::string& why : fitted->unmeasured) response->add_unmeasured(std::move(why));
  return grpc::Status::OK;
}

}  // namespace glasswing
