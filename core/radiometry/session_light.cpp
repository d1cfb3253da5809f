#include "core/radiometry/session_light.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kSameCrosstalk = 0.02;
constexpr double kMostUnmixing = 10.0;  // of a row of N^-1: light would be lost in what is amplified
constexpr float kMostPedestal = 0.25f;

absl::StatusOr<Eigen::Matrix3d> crosstalk_of(const v1::DisplayCalibration& calibration) {
  const auto bad = [&](const std::string& what) {
    return absl::InvalidArgumentError(
        fmt::format("the calibration of monitor \"{}\": {}", calibration.monitor(), what));
  };
  if (calibration.crosstalk_size() != 9)
    return bad(fmt::format("crosstalk is {} long; it must be 9 long", calibration.crosstalk_size()));
  Eigen::Matrix3d crosstalk;
  for (int i = 0; i < 9; ++i) {
    if (!std::isfinite(calibration.crosstalk(i))) return bad("crosstalk must be finite");
    crosstalk(i / 3, i % 3) = calibration.crosstalk(i);
  }
  for (int c = 0; c < 3; ++c) {
    const double white = crosstalk.row(c).sum();
    if (!(white > 0.0))
      return bad(fmt::format("a row of crosstalk has the sum {}; it must be above 0", white));
    crosstalk.row(c) /= white;
  }
  return crosstalk;
}

}  // namespace

absl::StatusOr<SessionLight> SessionLight::create(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(FrameLight curves, FrameLight::create(manifest));
  SessionLight light(std::move(curves));
  GW_RETURN_IF_ERROR(light.take_out_crosstalk(manifest));
  light.find_range();
  light.find_warnings(manifest);
  return light;
}

absl::Status SessionLight::take_out_crosstalk(const v1::CaptureManifest& manifest) {
  std::vector<Eigen::Matrix3d> of_monitors;
  for (const v1::DisplayCalibration& calibration : manifest.display_calibrations()) {
    if (calibration.crosstalk().empty()) continue;
    GW_ASSIGN_OR_RETURN(of_monitors.emplace_back(), crosstalk_of(calibration));
  }
  if (of_monitors.empty()) return absl::OkStatus();
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (const Eigen::Matrix3d& own : of_monitors) mean += own / static_cast<double>(of_monitors.size());
  double apart = 0.0;
  for (const Eigen::Matrix3d& own : of_monitors) apart = std::max(apart, (own - mean).cwiseAbs().maxCoeff());
  if (apart > kSameCrosstalk) {
    warnings_.push_back(
        fmt::format("the monitors' primaries differ by up to {:.1f} % of white as the camera sees them; "
                    "their mean is taken",
                    100.0 * apart));
  }
  const Eigen::Matrix3d unmix = mean.inverse();
  if (!unmix.allFinite() || unmix.cwiseAbs().rowwise().sum().maxCoeff() > kMostUnmixing) {
    return absl::InvalidArgumentError(
        "the calibrations of the monitors: their crosstalk hardly tells primaries apart; taking it out would "
        "amplify "
        "noise more than ten times");
  }
  unmixes_ = true;
  for (int p = 0; p < 3; ++p) {
    for (int c = 0; c < 3; ++c)
      unmix_[static_cast<size_t>(p)][static_cast<size_t>(c)] = static_cast<float>(unmix(p, c));
    noise_factor_[static_cast<size_t>(p)] = unmix.row(p).norm();
  }
  return absl::OkStatus();
}

void SessionLight::find_range() {
  float darkest = 0.0f;
  for (int c = 0; c < 3; ++c) darkest = std::min(darkest, curves_.light(0, c));
  darkest = std::max(darkest, -kMostPedestal);  // a curve's end may run far below what noise reaches
  lowest_ = highest_ = 0.0f;
  for (const std::array<float, 3>& row : unmix_) {
    float above = 0.0f, below = 0.0f;
    for (const float share : row) (share > 0.0f ? above : below) += share;
    lowest_ = std::min(lowest_, below + above * darkest);
    highest_ = std::max(highest_, above + below * darkest);
  }
}

void SessionLight::find_warnings(const v1::CaptureManifest& manifest) {
  if (!manifest.has_camera_calibration()) {
    if (manifest.camera().response() == "unknown") {
      warnings_.push_back(
          fmt::format("camera \"{}\" was not calibrated: its samples were taken for linear light, which "
                      "they may not be; `glasswing calibrate camera` measures it",
                      manifest.camera().name()));
    }
    return;
  }
  const v1::CameraCalibration& calibration = manifest.camera_calibration();
  for (const v1::Frame& frame : manifest.frames()) {
    if (calibration.gain() <= 0.0 || frame.gain() <= 0.0) continue;
    if (std::abs(frame.gain() / calibration.gain() - 1.0) <= 0.01) continue;
    warnings_.push_back(fmt::format("{} was taken with a gain of {}; camera \"{}\" was calibrated with {}",
                                    frame.file(), frame.gain(), calibration.camera(), calibration.gain()));
    return;
  }
}

}  // namespace glasswing
