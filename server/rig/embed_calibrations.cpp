#include "server/rig/embed_calibrations.h"

#include <fmt/format.h>

#include "core/base/status.h"

namespace glasswing {
namespace {

template <typename Device>
std::string shape_of(const Device& device) {
  return fmt::format("{} x {} px and {} bits", device.width_px(), device.height_px(), device.bits());
}

template <typename Calibration, typename Device>
absl::Status check_same(const Calibration& calibration, const Device& device, const char* kind,
                        const char* verb) {
  if (shape_of(calibration) == shape_of(device)) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("the calibration of {} \"{}\" was measured at {}; the device now has {}: measure it again "
                  "with glasswing calibrate {}, or drop the calibration: glasswing calibrate forget {}",
                  kind, device.name(), shape_of(calibration), shape_of(device), verb, device.name()));
}

}  // namespace

absl::Status embed_calibrations(const CalibrationStore& calibrations, v1::CaptureManifest& header) {
  const std::string& measured = header.plan().calibration().of();
  if (measured != "camera") {
    if (const auto camera = calibrations.camera(header.camera().name())) {
      GW_RETURN_IF_ERROR(check_same(*camera, header.camera(), "camera", "camera"));
      *header.mutable_camera_calibration() = *camera;
    }
  }
  if (!measured.empty()) return absl::OkStatus();
  for (const v1::Monitor& monitor : header.monitors()) {
    const auto display = calibrations.display(monitor.name());
    if (!display) continue;
    GW_RETURN_IF_ERROR(check_same(*display, monitor, "monitor", "display"));
    *header.add_display_calibrations() = *display;
  }
  return absl::OkStatus();
}

std::string uncalibrated_warning(const v1::CaptureManifest& header) {
  if (header.has_plan() && header.plan().has_calibration()) return "";
  if (header.has_camera_calibration() || header.camera().response() != "unknown") return "";
  return fmt::format(
      "camera \"{}\" is not linear and not calibrated, which biases widths and weights: "
      "glasswing calibrate camera",
      header.camera().name());
}

}  // namespace glasswing
