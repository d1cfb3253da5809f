#include "core/radiometry/frame_light.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr size_t kSamples = 65536;
constexpr int kMaxKnots = 65536;

template <typename Value>
absl::Status bad(const v1::CameraCalibration& calibration, const std::string& field, const Value& value,
                 const std::string& accepted) {
  return absl::InvalidArgumentError(fmt::format("the calibration of camera \"{}\": {} is {}; it must be {}",
                                                calibration.camera(), field, value, accepted));
}

std::vector<float> table_of(const v1::CameraCurve& curve) {
  std::vector<float> table(kSamples);
  const auto last = static_cast<float>(curve.light_size() - 1);
  for (size_t sample = 0; sample < kSamples; ++sample) {
    const float at = static_cast<float>(sample) / 65535.0f * last;
    const int before = std::min(static_cast<int>(at), curve.light_size() - 2);
    const float part = at - static_cast<float>(before);
    table[sample] = (1.0f - part) * curve.light(before) + part * curve.light(before + 1);
  }
  return table;
}

}  // namespace

absl::Status check_calibration(const v1::CameraCalibration& calibration) {
  if (calibration.format_version() != 1)
    return bad(calibration, "format_version", calibration.format_version(), "1");
  if (calibration.curves_size() != 3)
    return bad(calibration, "curves", fmt::format("{} long", calibration.curves_size()), "3 long: r, g, b");
  if (!(calibration.saturation() > 0.0 && calibration.saturation() <= 1.0))
    return bad(calibration, "saturation", calibration.saturation(), "in (0, 1]");
  for (const auto& [name, value] :
       {std::pair("read_sd", calibration.read_sd()), std::pair("shot_gain", calibration.shot_gain())}) {
    if (!(value >= 0.0 && value <= 1.0)) return bad(calibration, name, value, "in [0, 1]");
  }
  for (const v1::CameraCurve& curve : calibration.curves()) {
    if (curve.light_size() < 2 || curve.light_size() > kMaxKnots)
      return bad(calibration, "light", fmt::format("{} long", curve.light_size()), "2 to 65536 long");
    for (int k = 0; k < curve.light_size(); ++k) {
      if (!std::isfinite(curve.light(k))) return bad(calibration, "light", curve.light(k), "finite");
      if (k > 0 && !(curve.light(k) > curve.light(k - 1)))
        return bad(calibration, "light", "falling", "rising");
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<FrameLight> FrameLight::create(const v1::CaptureManifest& manifest) {
  if (manifest.has_camera_calibration()) return create(manifest.camera_calibration());
  FrameLight light;
  const auto black = static_cast<float>(manifest.camera().black_level());
  light.identity_ = black == 0.0f;
  for (std::vector<float>& table : light.light_) {
    table.resize(kSamples);
    for (size_t sample = 0; sample < kSamples; ++sample)
      table[sample] = (static_cast<float>(sample) / 65535.0f - black) / (1.0f - black);
  }
  return light;
}

absl::StatusOr<FrameLight> FrameLight::create(const v1::CameraCalibration& calibration) {
  GW_RETURN_IF_ERROR(check_calibration(calibration));
  FrameLight light;
  light.identity_ = false;
  light.saturation_ = static_cast<std::uint16_t>(std::lround(65535.0 * calibration.saturation()));
  for (int c = 0; c < 3; ++c) light.light_[c] = table_of(calibration.curves(c));
  return light;
}

FrameLight FrameLight::of_samples(const std::vector<std::uint16_t>& samples) {
  FrameLight light;
  light.identity_ = false;
  for (std::vector<float>& table : light.light_) {
    for (const std::uint16_t sample : samples) table.push_back(static_cast<float>(sample) / 65535.0f);
  }
  return light;
}

}  // namespace glasswing
