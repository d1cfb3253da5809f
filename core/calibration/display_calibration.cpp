#include "core/calibration/display_calibration.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include "core/base/status.h"
#include "core/calibration/display_shading.h"
#include "core/calibration/display_warnings.h"
#include "core/calibration/screen_view.h"

namespace glasswing {
namespace {

using Code = std::array<int, 3>;

bool is_black(const Code& code) {
  return code == Code{0, 0, 0};
}

struct Mean {
  std::array<double, 3> light{};
  double count = 0.0;
};
// The mean of each code shown at one exposure.
std::map<Code, Mean> means_of(const std::vector<SeenSolid>& seen, double exposure_ms) {
  std::map<Code, Mean> means;
  for (const SeenSolid& of : seen) {
    if (of.exposure_ms != exposure_ms || of.cut_off) continue;
    Mean& mean = means[of.solid.code];
    mean.count += 1.0;
    for (size_t c = 0; c < 3; ++c) mean.light[c] += (of.solid.light[c] - mean.light[c]) / mean.count;
  }
  return means;
}

// The ratio of light above black at exposure `to_ms` to that at `from_ms`, from the grays seen at both.
double ratio_of(const std::vector<SeenSolid>& seen, double from_ms, double to_ms) {
  const std::map<Code, Mean> from = means_of(seen, from_ms), to = means_of(seen, to_ms);
  double along = 0.0, square = 0.0;
  for (const auto& [code, mean] : from) {
    const auto same = to.find(code);
    if (is_black(code) || same == to.end()) continue;
    for (size_t c = 0; c < 3; ++c) {
      const double light = mean.light[c] - from.at({}).light[c];
      along += light * (same->second.light[c] - to.at({}).light[c]);
      square += light * light;
    }
  }
  return square > 0.0 ? along / square : to_ms / from_ms;
}

// The solids at `exposure_ms`, except that grays come from the longest exposure that does not clip them,
// scaled to `exposure_ms`.
std::vector<ShownSolid> on_one_scale(const std::vector<SeenSolid>& seen, double exposure_ms, int highest) {
  std::map<Code, double> longest_ms;
  for (const SeenSolid& of : seen) longest_ms.try_emplace(of.solid.code, exposure_ms);
  for (auto& [code, longest] : longest_ms) {
    if (is_black(code) || code == Code{highest, highest, highest}) continue;
    for (const SeenSolid& of : seen) {
      const bool unclipped = std::none_of(seen.begin(), seen.end(), [&, code = code](const SeenSolid& other) {
        const Code& shown = other.solid.code;
        return other.exposure_ms == of.exposure_ms && other.cut_off && (shown == code || is_black(shown));
      });
      if (of.solid.code == code && unclipped) longest = std::max(longest, of.exposure_ms);
    }
  }
  std::map<double, double> ratios;
  std::map<double, Mean> blacks;
  for (const auto& [code, longest] : longest_ms) {
    if (!ratios.contains(longest)) {
      ratios[longest] = longest == exposure_ms ? 1.0 : ratio_of(seen, longest, exposure_ms);
      blacks[longest] = means_of(seen, longest)[{}];
    }
  }
  std::vector<ShownSolid> solids;
  for (const SeenSolid& of : seen) {
    if (of.exposure_ms != longest_ms[of.solid.code]) continue;
    ShownSolid& solid = solids.emplace_back(of.solid);
    if (of.exposure_ms == exposure_ms) continue;
    const double ratio = ratios[of.exposure_ms];
    for (size_t c = 0; c < 3; ++c) {
      const double above = solid.light[c] - blacks[of.exposure_ms].light[c];
      solid.light[c] = blacks[exposure_ms].light[c] + ratio * above;
      solid.error[c] *= ratio;
    }
  }
  return solids;
}

std::vector<ShownSolid> all_of_code(const std::vector<ShownSolid>& solids, int code) {
  std::vector<ShownSolid> some;
  std::copy_if(solids.begin(), solids.end(), std::back_inserter(some), [code](const ShownSolid& solid) {
    return solid.code == Code{code, code, code};
  });
  return some;
}

// The relative standard deviation of white beyond noise and steady drift: from the distance of each white to
// the line between its neighbours in time.
double flicker_of(std::vector<ShownSolid> whites) {
  std::sort(whites.begin(), whites.end(),
            [](const ShownSolid& a, const ShownSolid& b) { return a.at < b.at; });
  double square = 0.0, noise = 0.0, weights = 0.0;
  for (size_t i = 1; i + 1 < whites.size(); ++i) {
    const ShownSolid &before = whites[i - 1], &here = whites[i], &after = whites[i + 1];
    const double share = static_cast<double>((here.at - before.at).count()) /
                         static_cast<double>(std::max((after.at - before.at).count(), std::int64_t{1}));
    // The variance of the distance, in units of one white's variance.
    weights += 1.0 + share * share + (1.0 - share) * (1.0 - share);
    double off = 0.0, error = 0.0;
    for (size_t c = 0; c < 3; ++c) {
      off += here.light[c] / std::lerp(before.light[c], after.light[c], share) - 1.0;
      error += here.error[c] / here.light[c];
    }
    square += off * off / 9.0;
    noise += error * error / 27.0;  // of a mean of three channels
  }
  if (weights == 0.0) return 0.0;
  const double count = static_cast<double>(whites.size()) - 2.0;
  return std::sqrt(std::max(square / weights - noise / count, 0.0));
}

// The largest relative change of white.
double drift_of(const std::vector<ShownSolid>& whites) {
  double drift = 0.0;
  for (size_t c = 0; c < 3; ++c) {
    const auto [min, max] = std::minmax_element(
        whites.begin(), whites.end(),
        [c](const ShownSolid& a, const ShownSolid& b) { return a.light[c] < b.light[c]; });
    if (!whites.empty()) drift = std::max(drift, max->light[c] / min->light[c] - 1.0);
  }
  return drift;
}

void set_response(const DisplayResponse& response, v1::DisplayCalibration& calibration) {
  for (const ToneFit& fit : response.primary) {
    v1::ToneCurve& curve = *calibration.add_primaries();
    for (const double radiance : fit.curve.radiances()) curve.add_radiance(static_cast<float>(radiance));
    for (const double error : fit.error) curve.add_error(static_cast<float>(error));
    curve.set_gamma(fit.gamma);
    curve.set_residual_rms(fit.residual_rms);
  }
  for (const std::array<double, 3>& row : response.crosstalk)
    calibration.mutable_crosstalk()->Add(row.begin(), row.end());
  calibration.mutable_black()->Add(response.black.begin(), response.black.end());
  calibration.set_excess_of_white(response.excess_of_white.value_or(0.0));
}

absl::StatusOr<v1::DisplayCalibration> calibrate(const MappedArchive& archive, const FrameLight& light,
                                                 const Shading& shading, const v1::Monitor& monitor,
                                                 const ShownFrames& shown) {
  const int bits = bits_of(monitor), highest = (1 << bits) - 1;
  if (std::any_of(shown.solids.begin(), shown.solids.end(),
                  [](const ShownFrame& solid) { return solid.at == nanoseconds(0); })) {
    return absl::FailedPreconditionError("its frames do not record when they were exposed");
  }
  GW_ASSIGN_OR_RETURN(const ScreenView view, find_screen(archive, light, shown, bits));
  std::vector<SeenSolid> seen;
  for (const ShownFrame& solid : shown.solids) seen.push_back(see(archive, light, view.pixels, solid));
  std::vector<ShownSolid> solids = on_one_scale(seen, view.exposure_ms, highest);

  const std::vector<ShownSolid> whites = all_of_code(solids, highest);
  const double flicker = flicker_of(whites);
  for (ShownSolid& solid : solids) {
    for (size_t c = 0; c < 3; ++c) solid.error[c] = std::hypot(solid.error[c], flicker * solid.light[c]);
  }
  GW_ASSIGN_OR_RETURN(const std::vector<ShownSolid> steady, without_drift(solids, bits));
  GW_ASSIGN_OR_RETURN(const DisplayResponse response, fit_display_response(steady, bits));

  const v1::CaptureManifest& manifest = archive.manifest();
  v1::DisplayCalibration calibration;
  calibration.set_format_version(1);
  calibration.set_monitor(monitor.name());
  calibration.set_measured(utc_now_rfc3339());
  calibration.set_session(manifest.session());
  calibration.set_camera(manifest.camera().name());
  calibration.set_width_px(monitor.width_px());
  calibration.set_height_px(monitor.height_px());
  calibration.set_bits(bits);
  calibration.set_exposure_ms(view.exposure_ms);
  calibration.set_drift(drift_of(whites));
  set_response(response, calibration);
  if (const auto uniformity = measure_display_shading(view, response, shading))
    *calibration.mutable_uniformity() = *uniformity;
  for (std::string& warning : display_warnings(calibration, steady, response, flicker))
    calibration.add_warnings(std::move(warning));
  return calibration;
}

}  // namespace

absl::StatusOr<DisplayCalibrations> calibrate_displays(const MappedArchive& archive) {
  const v1::CaptureManifest& manifest = archive.manifest();
  if (const std::string& of = manifest.plan().calibration().of(); of != "display") {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" is not a calibration of displays (its plan's calibration is of \"{}\"): capture one",
        manifest.session(), of));
  }
  if (!manifest.has_camera_calibration() && manifest.camera().response() == "unknown") {
    return absl::FailedPreconditionError(
        fmt::format("camera \"{}\" is not linear, and not calibrated: calibrate it "
                    "first, then capture this again",
                    manifest.camera().name()));
  }
  GW_ASSIGN_OR_RETURN(const FrameLight light, FrameLight::create(manifest));
  GW_ASSIGN_OR_RETURN(const Shading shading, Shading::create(manifest));
  DisplayCalibrations calibrations;
  for (const v1::Monitor& monitor : manifest.monitors()) {
    const ShownFrames shown = shown_frames(manifest, monitor);
    if (shown.solids.empty() && shown.ramps.empty()) continue;
    absl::StatusOr<v1::DisplayCalibration> calibration = calibrate(archive, light, shading, monitor, shown);
    if (calibration.ok()) {
      calibrations.measured.push_back(*std::move(calibration));
    } else {
      calibrations.unmeasured.push_back(
          fmt::format("monitor \"{}\": {}", monitor.name(), std::string(calibration.status().message())));
    }
  }
  if (calibrations.measured.empty() && !calibrations.unmeasured.empty())
    return absl::FailedPreconditionError(fmt::format("{}", fmt::join(calibrations.unmeasured, "; ")));
  if (calibrations.measured.empty()) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" has no frames of any monitor's codes", manifest.session()));
  }
  return calibrations;
}

}  // namespace glasswing
