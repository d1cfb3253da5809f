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

absl::StatusOr<v1::FitCameraResponse> fit_camera(ArchiveStore& store, const std::string& session) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedArchive> archive, map(store, session));
  v1::FitCameraResponse response;
  GW_ASSIGN_OR_RETURN(*response.mutable_calibration(), calibrate_camera(*archive));
  return response;
}

absl::StatusOr<v1::FitDisplaysResponse> fit_displays(ArchiveStore& store, const std::string& session) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<const MappedArchive> archive, map(store, session));
  GW_ASSIGN_OR_RETURN(DisplayCalibrations fitted, calibrate_displays(*archive));
  v1::FitDisplaysResponse response;
  for (v1::DisplayCalibration& display : fitted.measured) *response.add_calibrations() = std::move(display);
  for (std::string& why : fitted.unmeasured) response.add_unmeasured(std::move(why));
  return response;
}

}  // namespace

grpc::Status CalibrationServiceImpl::FitCamera(grpc::ServerContext* context,
                                               const v1::FitCameraRequest* request,
                                               v1::FitCameraResponse* response) {
  return answer(
      camera_fits_.run(*context, request->session(), [&] { return fit_camera(store_, request->session()); }),
      *response);
}

grpc::Status CalibrationServiceImpl::FitDisplays(grpc::ServerContext* context,
                                                 const v1::FitDisplaysRequest* request,
                                                 v1::FitDisplaysResponse* response) {
  return answer(display_fits_.run(*context, request->session(),
                                  [&] { return fit_displays(store_, request->session()); }),
                *response);
}

}  // namespace glasswing
