#include "server/rig/calibration_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/status.h"
#include "core/pattern/plan.h"

namespace glasswing {
namespace {

constexpr double kLadder[] = {43.0, 25.0, 15.0, 8.3, 5.1, 2.9, 1.6, 1.0};  // longest exposure / each exposure
constexpr size_t kMinExposures = 4;
constexpr double kWhiteShare = 0.8;  // of full scale

absl::StatusOr<v1::Plan> plan_for(const v1::GetCameraResponse& camera, const std::vector<v1::Monitor>& rig,
                                  const std::vector<std::string>& names, const std::string& of,
                                  const std::vector<double>& exposures_ms) {
  if (rig.empty()) return absl::FailedPreconditionError("no display node is up; start glasswing-display");
  v1::Plan plan;
  plan.set_method(std::string(kCalibrationMethod));
  plan.mutable_calibration()->set_of(of);
  for (const std::string& name : names) plan.add_monitors()->set_name(name);
  double slowest_hz = 1e9;
  for (const v1::Monitor& monitor : rig) slowest_hz = std::min(slowest_hz, monitor.refresh_hz());
  for (const double exposure_ms : exposures_ms) plan.add_exposure_ms(exposure_ms);
  // Exposure, readout, and up to one frame interval until an exposure begins; then one refresh for the
  // change, and one for lag and settling.
  const double needed_ms = *std::max_element(exposures_ms.begin(), exposures_ms.end()) +
                           1e-6 * static_cast<double>(camera.readout_ns()) + 1e3 / camera.frame_rate_hz();
  plan.set_hold_refreshes(std::min(600, 2 + static_cast<int>(std::ceil(1e-3 * needed_ms * slowest_hz))));
  GW_RETURN_IF_ERROR(check_plan(plan));
  GW_RETURN_IF_ERROR(expand(plan, rig).status());
  return plan;
}

}  // namespace

absl::Status check_calibrates(const v1::GetCameraResponse& camera) {
  if (!camera.on_demand()) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format(
      "pictures of camera \"{}\" are proven only by the id patch, which calibrations do not show; "
      "raw files are linear, so that mattes need no calibration of the camera: calibrate the "
      "monitors, if they need it, with a camera that timestamps its frames",
      camera.camera().name()));
}

std::vector<double> exposure_ladder_ms(const v1::GetCameraResponse& camera, double longest_ms) {
  const double top_ms = std::min(longest_ms, camera.max_exposure_ms());
  std::vector<double> exposures_ms;
  for (const double part : kLadder) {
    // Rounded down to 0.1 ms, which every camera can make.
    const double exposure_ms = top_ms / part;
    const double kept_ms = exposure_ms < 1.0 ? exposure_ms : std::floor(10.0 * exposure_ms) / 10.0;
    if (kept_ms >= camera.min_exposure_ms()) exposures_ms.push_back(kept_ms);
  }
  return exposures_ms;
}

absl::StatusOr<v1::Plan> camera_plan(const v1::GetCameraResponse& camera, const std::vector<v1::Monitor>& rig,
                                     const std::vector<std::string>& names, double longest_ms) {
  GW_RETURN_IF_ERROR(check_calibrates(camera));
  const std::vector<double> exposures_ms = exposure_ladder_ms(camera, longest_ms);
  if (exposures_ms.size() < kMinExposures) {
    return absl::FailedPreconditionError(fmt::format(
        "the camera takes exposures of {:.3g} to {:.3g} ms; too few to measure its curve: a lower "
        "frame rate allows longer ones",
        camera.min_exposure_ms(), camera.max_exposure_ms()));
  }
  return plan_for(camera, rig, names, "camera", exposures_ms);
}

absl::StatusOr<v1::Plan> display_plan(const v1::GetCameraResponse& camera,
                                      const std::vector<v1::Monitor>& rig,
                                      const std::vector<std::string>& names, double white_ms) {
  GW_RETURN_IF_ERROR(check_calibrates(camera));
  const double exposure_ms =
      std::clamp(kWhiteShare * white_ms, camera.min_exposure_ms(), camera.max_exposure_ms());
  return plan_for(camera, rig, names, "display", {exposure_ms});
}

}  // namespace glasswing
