#include "core/calibration/camera_calibration.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/calibration/below_black.h"
#include "core/calibration/calibration_samples.h"
#include "core/calibration/camera_shading.h"
#include "core/calibration/camera_symptoms.h"
#include "core/radiometry/camera_response.h"
#include "core/radiometry/frame_light.h"
#include "core/radiometry/noise_model.h"

namespace glasswing {
namespace {

constexpr double kFull = 65535.0;
constexpr double kHopeless = 0.25;         // relative, of exposure times
constexpr double kShutterSd = 0.01;        // relative; electronic shutters are better
constexpr double kBelowFull = 0.99;        // of the saturation: above, noise is partly clipped
constexpr size_t kPileUp = 1000;           // samples of the highest code
constexpr double kMaxClippedWhite = 1e-3;  // share of white's samples
constexpr double kReach = 3.0;             // standard deviations
constexpr double kOneSigma = 0.8413;       // quantile
constexpr double kUnlit = 0.1;             // of the noise
// Light as codes for fit_noise, with room for noise below black and above saturation.
constexpr double kPedestal = 0.1, kUnit = 0.8;

// The code where samples pile up because the sensor or its converter saturates; 1 if there is none.
double find_saturation(const CalibrationSamples& samples) {
  std::vector<size_t> count(65536);
  for (const SampledMonitor& monitor : samples.monitors) {
    for (size_t j = 0; j < samples.exposures_ms.size(); ++j) {
      for (const auto& take : monitor.takes(j, Shown::kWhite)) {
        for (const std::uint16_t code : take) ++count[code];
      }
    }
  }
  size_t top = count.size() - 1, below = 0;
  while (top > 0 && count[top] == 0) --top;
  for (size_t code = top - std::min<size_t>(top, 655); code < top; ++code) below += count[code];
  return count[top] >= kPileUp && count[top] > below ? static_cast<double>(top) / kFull : 1.0;
}

// A quantile, with codes spread evenly over their steps. Unlike a mean, it is unaffected by the curve or by
// clipping below it.
double quantile_code(const std::vector<size_t>& count, double quantile) {
  size_t all = 0, below = 0;
  for (const size_t n : count) all += n;
  size_t code = 0;
  const double wanted = quantile * static_cast<double>(all);
  while (static_cast<double>(below + count[code]) < wanted) below += count[code++];
  if (code == 0) return 0.0;
  const auto neighbour = [&](int direction) {
    int at = static_cast<int>(code) + direction;
    while (at >= 0 && at <= 65535 && count[at] == 0) at += direction;
    return at < 0 || at > 65535 ? static_cast<double>(code) : static_cast<double>(at);
  };
  const double from = 0.5 * (neighbour(-1) + static_cast<double>(code)),
               until = 0.5 * (neighbour(1) + static_cast<double>(code));
  const double share = (wanted - static_cast<double>(below)) / static_cast<double>(count[code]);
  return (from + share * (until - from)) / kFull;
}

// The histogram of black in one channel at one exposure.
std::vector<size_t> black_codes(const CalibrationSamples& samples, size_t exposure, size_t channel) {
  std::vector<size_t> count(65536);
  for (const SampledMonitor& monitor : samples.monitors) {
    for (const auto& take : monitor.takes(exposure, Shown::kBlack)) {
      for (size_t i = channel; i < take.size(); i += 3) ++count[take[i]];
    }
  }
  return count;
}

// The histogram of black over all exposures in which room light shifts it by less than a tenth of its noise.
std::vector<size_t> unlit_codes(const CalibrationSamples& samples, size_t channel, double black_level) {
  std::vector<size_t> all(65536);
  for (size_t j = 0; j < samples.exposures_ms.size(); ++j) {
    const std::vector<size_t> count = black_codes(samples, j, channel);
    const double median = quantile_code(count, 0.5), sd = quantile_code(count, kOneSigma) - median;
    if (std::abs(median - black_level) > kUnlit * sd) continue;
    std::transform(all.begin(), all.end(), count.begin(), all.begin(), std::plus<>());
  }
  return all;
}

// The code of black without room light, in one channel. Room light grows with the exposure, and the codes of
// a curved camera grow nonlinearly, least so at short exposures: hence a weighted parabola, evaluated at 0.
double find_black_level(const CalibrationSamples& samples, size_t channel) {
  const auto terms = std::min<Eigen::Index>(3, samples.exposures_ms.size());
  Eigen::MatrixXd rows(samples.exposures_ms.size(), terms);
  Eigen::VectorXd codes(rows.rows());
  for (size_t j = 0; j < samples.exposures_ms.size(); ++j) {
    const std::vector<size_t> count = black_codes(samples, j, channel);
    const double time = samples.exposures_ms[j] / samples.exposures_ms[0], weight = 1.0 / (time * time);
    const auto row = static_cast<Eigen::Index>(j);
    for (Eigen::Index k = 0; k < terms; ++k) rows(row, k) = weight * std::pow(time, k);
    codes[row] = weight * quantile_code(count, 0.5);
  }
  return std::max(rows.colPivHouseholderQr().solve(codes)[0], 0.0);
}

// The stripe at one exposure as a picture of all sampled pixels, averaged over takes. Clipped samples are
// full or 0.
Image16 mean_stripe(const CalibrationSamples& samples, size_t exposure, double saturation) {
  size_t pixels = 0;
  for (const SampledMonitor& monitor : samples.monitors) pixels += monitor.radius2.size();
  const int side = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(pixels))));
  Image16 image(side + 2, side + 2);  // CameraResponse ignores the rim
  const auto full = static_cast<std::uint16_t>(std::lround(kFull * saturation));
  size_t at = 0;
  for (const SampledMonitor& monitor : samples.monitors) {
    const SampledMonitor::Takes& takes = monitor.takes(exposure, Shown::kStripe);
    for (size_t i = 0; i < monitor.sample_count(); ++i) {
      const size_t pixel = at + i / 3, across = static_cast<size_t>(side);
      double sum = 0.0;
      bool bright = false, dark = false;
      for (const auto& take : takes) {
        sum += take[i];
        bright = bright || take[i] >= full;
        dark = dark || take[i] == 0;
      }
      image.at(static_cast<int>(pixel % across) + 1, static_cast<int>(pixel / across) + 1,
               static_cast<int>(i % 3)) =
          bright ? 65535
          : dark ? 0
                 : static_cast<std::uint16_t>(std::lround(sum / static_cast<double>(takes.size())));
    }
    at += monitor.radius2.size();
  }
  return image;
}

absl::StatusOr<CameraResponse> fit_response(const CalibrationSamples& samples, double saturation,
                                            const std::array<double, 3>& black) {
  std::vector<Exposure> exposures;
  for (size_t j = 0; j < samples.exposures_ms.size(); ++j) {
    exposures.push_back({samples.exposures_ms[j] / 1000.0, mean_stripe(samples, j, saturation)});
  }
  ResponseOptions options;
  options.black_level = black;
  options.saturation = kBelowFull * saturation;
  options.exposure_sd = kShutterSd;
  options.alignment_sd_px = 0.0;  // nothing moves
  return CameraResponse::fit(exposures, options);
}

void add_curve(const CameraResponse& response, int channel, double black_level,
               v1::CameraCalibration& calibration) {
  v1::CameraCurve& curve = *calibration.add_curves();
  const double unit = response.exposure_of(calibration.saturation(), channel);
  for (int k = 0; k < CameraResponse::kKnots; ++k) {
    curve.add_light(
        static_cast<float>(response.exposure_of(k / (CameraResponse::kKnots - 1.0), channel) / unit));
    curve.add_error(static_cast<float>(response.standard_error(k, channel) / unit));
  }
  curve.set_black_level(black_level);
  curve.set_darkest_seen(response.darkest_seen(channel));
  curve.set_brightest_seen(response.brightest_seen(channel));
}

Image16 as_light(const std::vector<std::uint16_t>& codes, const FrameLight& light) {
  Image16 image(static_cast<int>(codes.size() / 3), 1);
  for (size_t i = 0; i < codes.size(); ++i) {
    const double value = kPedestal + kUnit * light.light(codes[i], static_cast<int>(i % 3));
    // 0 and full scale stay clipped.
    image.samples[i] = codes[i] == 0               ? 0
                       : light.saturated(codes[i]) ? 65535
                                                   : code16_of(static_cast<float>(value));
  }
  return image;
}

// The relative standard error of the curves' slope near black, within reach of the noise, which scales the
// noise in light.
double slope_error(const v1::CameraCalibration& calibration, double read_sd) {
  double max_error = 0.0;
  for (const v1::CameraCurve& curve : calibration.curves()) {
    int k = 0;
    while (k + 1 < curve.light_size() && curve.light(k) < kReach * read_sd) ++k;
    max_error = std::max(max_error, static_cast<double>(curve.error(k) / curve.light(k)));
  }
  return max_error;
}

absl::Status add_noise(const CalibrationSamples& samples, const FrameLight& light,
                       v1::CameraCalibration& calibration) {
  std::vector<std::vector<Image16>> scenes;
  for (const SampledMonitor& monitor : samples.monitors) {
    for (size_t j = 0; j < samples.exposures_ms.size(); ++j) {
      std::vector<Image16>& scene = scenes.emplace_back();
      for (const auto& take : monitor.takes(j, Shown::kStripe)) scene.push_back(as_light(take, light));
    }
  }
  GW_ASSIGN_OR_RETURN(const NoiseModel noise, fit_noise(scenes, kPedestal));
  calibration.set_read_sd(noise.read_sd / kUnit);
  const double of_slope = calibration.linear() ? 0.0 : slope_error(calibration, calibration.read_sd());
  calibration.set_read_sd_error(std::hypot(noise.read_sd_error / kUnit, of_slope * calibration.read_sd()));
  calibration.set_shot_gain(std::max(noise.gain, 0.0) / kUnit);
  calibration.set_shot_gain_error(noise.gain_error / kUnit);
  return absl::OkStatus();
}

// The longest exposure at which almost none of a monitor's white is clipped.
std::optional<size_t> longest_unclipped(const SampledMonitor& monitor, const FrameLight& light) {
  std::optional<size_t> found;
  for (size_t j = 0; j < monitor.frames.size(); ++j) {
    size_t clipped = 0;
    const auto& codes = monitor.takes(j, Shown::kWhite).front();
    for (const std::uint16_t code : codes) clipped += light.saturated(code) ? 1 : 0;
    if (static_cast<double>(clipped) <= kMaxClippedWhite * static_cast<double>(codes.size())) found = j;
  }
  return found;
}

void add_white(const CalibrationSamples& samples, const FrameLight& light,
               v1::CameraCalibration& calibration) {
  std::vector<ShadingPoint> points;
  double brightest_per_ms = 0.0;
  for (size_t m = 0; m < samples.monitors.size(); ++m) {
    const SampledMonitor& monitor = samples.monitors[m];
    const std::optional<size_t> j = longest_unclipped(monitor, light);
    if (!j) continue;
    const auto mean = [&](Shown shown, size_t i) {
      double sum = 0.0;
      for (const auto& take : monitor.takes(*j, shown))
        sum += static_cast<double>(light.light(take[i], static_cast<int>(i % 3)));
      return sum / static_cast<double>(monitor.takes(*j, shown).size());
    };
    std::array<std::vector<double>, 3> whites;
    for (size_t i = 0; i < monitor.sample_count(); ++i) {
      const double white = mean(Shown::kWhite, i), above = white - mean(Shown::kBlack, i);
      whites[i % 3].push_back(white);
      if (above > 0.0)
        points.push_back({.group = 3 * m + i % 3, .radius2 = monitor.radius2[i / 3], .light = above});
    }
    for (std::vector<double>& own : whites)
      brightest_per_ms = std::max(brightest_per_ms, brightest(std::move(own)) / samples.exposures_ms[*j]);
  }
  if (brightest_per_ms > 0.0) calibration.set_white_ms(1.0 / brightest_per_ms);
  if (std::optional<v1::FallOff> fall_off = fit_camera_shading(points))
    *calibration.mutable_fall_off() = *std::move(fall_off);
}

}  // namespace

absl::StatusOr<v1::CameraCalibration> calibrate_camera(const MappedArchive& archive) {
  GW_ASSIGN_OR_RETURN(const CalibrationSamples samples, sample_calibration(archive));
  const v1::CaptureManifest& manifest = archive.manifest();
  v1::CameraCalibration calibration;
  calibration.set_format_version(1);
  calibration.set_camera(manifest.camera().name());
  calibration.set_measured(utc_now_rfc3339());
  calibration.set_session(manifest.session());
  calibration.set_width_px(manifest.camera().width_px());
  calibration.set_height_px(manifest.camera().height_px());
  calibration.set_bits(manifest.camera().bits());
  calibration.set_gain(manifest.frames(0).gain());
  calibration.set_saturation(find_saturation(samples));

  std::array<double, 3> black{};
  for (size_t c = 0; c < 3; ++c) black[c] = find_black_level(samples, c);
  GW_RETURN_IF_ERROR(check_codes_follow(samples, black, calibration.saturation()));
  GW_ASSIGN_OR_RETURN(const CameraResponse response, fit_response(samples, calibration.saturation(), black));
  const TimesOff off = times_off(samples.exposures_ms, response.exposures_s());
  if (off.max > kHopeless) {
    return absl::FailedPreconditionError(fmt::format(
        "{}, so no curve can be fitted; turn automatic exposure and automatic gain of the camera off",
        off.text));
  }
  calibration.set_linear(response.is_linear());
  for (size_t c = 0; c < 3; ++c) {
    add_curve(response, static_cast<int>(c), black[c], calibration);
    if (!response.is_linear())
      continue_below_black(unlit_codes(samples, c, black[c]), *calibration.mutable_curves()->rbegin());
  }
  GW_ASSIGN_OR_RETURN(const FrameLight light, FrameLight::create(calibration));
  GW_RETURN_IF_ERROR(add_noise(samples, light, calibration));
  add_white(samples, light, calibration);
  if (off.max > kOwnChange) {
    calibration.add_warnings(fmt::format("automatic exposure or gain: {}; turn both off", off.text));
  }
  for (std::string& symptom : symptoms(samples, calibration, light))
    calibration.add_warnings(std::move(symptom));
  return calibration;
}

}  // namespace glasswing
