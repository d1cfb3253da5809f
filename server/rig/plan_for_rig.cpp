#include "server/rig/plan_for_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "core/base/status.h"
#include "core/pattern/plan_fit.h"
#include "core/radiometry/tone_curve.h"
#include "server/rig/calibration_plan.h"

namespace glasswing {
namespace {

constexpr double kLongestMs = 16.0;      // of a camera's ladder, unless captures use longer exposures
constexpr double kUnknownWhiteMs = 5.0;  // white_ms of an uncalibrated camera
constexpr double kMaxBlur_px = 200.0;
constexpr int kMaxImages = 20000;

using Monitors = std::vector<v1::Monitor>;

absl::StatusOr<v1::MakePlanResponse> capture_plan(const v1::MakePlanRequest& request, RigLimits limits) {
  const auto quality = plan_qualities().find(request.quality().empty() ? "good" : request.quality());
  if (quality == plan_qualities().end()) {
    return absl::InvalidArgumentError(
        fmt::format("quality is \"{}\"; it must be draft, good or best", request.quality()));
  }
  const auto object = object_kinds().find(request.object().empty() ? "clear" : request.object());
  if (object == object_kinds().end()) {
    return absl::InvalidArgumentError(
        fmt::format("object is \"{}\"; it must be clear, frosted, metal or dark", request.object()));
  }
  if (request.image_count() < 0 || request.image_count() > kMaxImages) {
    return absl::InvalidArgumentError(
        fmt::format("image_count is {}; it must be 0 to {}", request.image_count(), kMaxImages));
  }
  if (!(request.blur_px() >= 0.0 && request.blur_px() <= kMaxBlur_px)) {
    return absl::InvalidArgumentError(
        fmt::format("blur_px is {}; it must be 0 to {}", request.blur_px(), kMaxBlur_px));
  }
  limits.blur_px = request.blur_px();
  PlanWish wish{.quality = quality->second, .images = {}, .object = object->second};
  if (request.image_count() > 0) wish.images = request.image_count();
  v1::MakePlanResponse response;
  GW_ASSIGN_OR_RETURN(*response.mutable_plan(), make_plan(wish, limits));
  response.set_text(plan_text(response.plan(), limits));
  return response;
}

// Those whose codes map to light through a curve. Notes the others.
MonitorNames with_curves(const Monitors& monitors, v1::MakePlanResponse& response) {
  MonitorNames names;
  for (const v1::Monitor& monitor : monitors) {
    if (monitor.bits() <= kMaxCurveBits) {
      names.push_back(monitor.name());
    } else {
      response.add_notes(fmt::format("monitor {} uses linear {}-bit codes: nothing to measure",
                                     monitor.name(), monitor.bits()));
    }
  }
  return names;
}

absl::StatusOr<v1::MakePlanResponse> camera_calibration(const v1::MakePlanRequest& request,
                                                        const RigLinks& rig, const Monitors& monitors) {
  v1::MakePlanResponse response;
  GW_ASSIGN_OR_RETURN(
      *response.mutable_plan(),
      camera_plan(rig.camera_info, monitors, {request.monitors().begin(), request.monitors().end()},
                  std::max(kLongestMs, request.longest_exposure_ms())));
  return response;
}

absl::StatusOr<v1::MakePlanResponse> display_calibration(const v1::MakePlanRequest& request,
                                                         const RigLinks& rig, const Monitors& monitors,
                                                         const CalibrationStore& calibrations) {
  v1::MakePlanResponse response;
  MonitorNames names(request.monitors().begin(), request.monitors().end());
  if (names.empty()) names = with_curves(monitors, response);
  if (names.empty() && !monitors.empty()) return response;
  const std::optional<v1::CameraCalibration> camera = calibrations.camera(rig.camera_info.camera().name());
  const double white_ms = camera && camera->white_ms() > 0.0 ? camera->white_ms() : kUnknownWhiteMs;
  GW_ASSIGN_OR_RETURN(*response.mutable_plan(), display_plan(rig.camera_info, monitors, names, white_ms));
  return response;
}

absl::StatusOr<v1::MakePlanResponse> plan_of_purpose(const v1::MakePlanRequest& request, const RigLinks& rig,
                                                     Monitors monitors,
                                                     const CalibrationStore& calibrations) {
  switch (request.purpose()) {
    case v1::PLAN_PURPOSE_CAPTURE:
      std::erase_if(monitors, [&](const v1::Monitor& monitor) {
        return !request.monitors().empty() && std::ranges::count(request.monitors(), monitor.name()) == 0;
      });
      return capture_plan(request, {.monitors = std::move(monitors), .camera = rig.camera_info});
    case v1::PLAN_PURPOSE_CALIBRATE_CAMERA:
      return camera_calibration(request, rig, monitors);
    case v1::PLAN_PURPOSE_CALIBRATE_DISPLAYS:
      return display_calibration(request, rig, monitors, calibrations);
    default:
      return absl::InvalidArgumentError(
          "the purpose is not given; it must be CAPTURE, CALIBRATE_CAMERA or CALIBRATE_DISPLAYS");
  }
}

}  // namespace

absl::StatusOr<v1::MakePlanResponse> plan_for_rig(const v1::MakePlanRequest& request, const RigLinks& rig,
                                                  const CalibrationStore& calibrations) {
  GW_ASSIGN_OR_RETURN(Monitors monitors, rig.monitors());
  GW_RETURN_IF_ERROR(check_monitors({request.monitors().begin(), request.monitors().end()}, monitors));
  GW_ASSIGN_OR_RETURN(v1::MakePlanResponse response,
                      plan_of_purpose(request, rig, std::move(monitors), calibrations));
  if (response.has_plan()) response.mutable_plan()->set_camera(request.camera());
  return response;
}

}  // namespace glasswing
