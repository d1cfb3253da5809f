#include "core/calibration/camera_symptoms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/median.h"

namespace glasswing {
namespace {

// sqrt(1 + x^2) is 1.05 at x = 0.32.
constexpr double kShareOfNoise = 0.32;
constexpr double kSigmas = 5.0;
constexpr double kBright = 0.1, kNearlyFull = 0.95;  // light
constexpr size_t kMinRatios = 200;
constexpr double kPeak = 0.98;  // quantile: where the stripe is as bright as white
constexpr double kClippedShare = 0.01;
constexpr double kTwoExposures = 1.2;  // ratio of times that codes must reflect
constexpr double kReaches = 0.8;       // of the saturation

// Light of each sample, averaged over takes; negative where a take is saturated.
std::vector<float> mean_light(const SampledMonitor::Takes& takes, const FrameLight& light) {
  std::vector<float> out(takes.front().size());
  for (size_t i = 0; i < out.size(); ++i) {
    for (const auto& take : takes) {
      out[i] = light.saturated(take[i]) || out[i] < 0.0f
                   ? -1.0f
                   : out[i] + std::max(light.light(take[i], static_cast<int>(i % 3)), 0.0f);
    }
    if (out[i] > 0.0f) out[i] /= static_cast<float>(takes.size());
  }
  return out;
}

// The brightness of one picture's takes relative to their mean: factors[channel][take].
struct Repeats {
  size_t exposure = 0;
  std::array<std::vector<double>, 3> factors;
  double error = 0.0;  // standard error of a factor, from noise alone
  double common(size_t take) const { return (factors[0][take] + factors[1][take] + factors[2][take]) / 3.0; }
  size_t takes() const { return factors[0].size(); }
};

class Symptoms {
 public:
  Symptoms(const CalibrationSamples& samples, const v1::CameraCalibration& calibration,
           const FrameLight& light)
      : samples_(samples), calibration_(calibration), light_(light), pixel_noise_(noise_at(1.0)) {}

  std::vector<std::string> find() {
    for (const SampledMonitor& monitor : samples_.monitors) {
      for (size_t j = 0; j < samples_.exposures_ms.size(); ++j) {
        add_repeats(monitor, j, Shown::kStripe);
        add_repeats(monitor, j, Shown::kWhite);
      }
    }
    for (const std::string& name : samples_.unseen) {
      out_.push_back(fmt::format("the camera does not see monitor \"{}\": nothing of it was measured", name));
    }
    look_for_flicker();
    look_for_jumps();
    for (const SampledMonitor& monitor : samples_.monitors) compare_with_white(monitor);
    look_for_white_balance();
    look_for_clipping();
    return std::move(out_);
  }

 private:
  double noise_at(double light) const {
    return std::sqrt(calibration_.read_sd() * calibration_.read_sd() + calibration_.shot_gain() * light);
  }

  void add_repeats(const SampledMonitor& monitor, size_t exposure, Shown shown) {
    const SampledMonitor::Takes& takes = monitor.takes(exposure, shown);
    const std::vector<float> mean = mean_light(takes, light_);
    Repeats repeats{.exposure = exposure, .factors = {}, .error = 0.0};
    for (size_t c = 0; c < 3; ++c) {
      for (const auto& take : takes) {
        std::vector<double> ratios;
        double light = 0.0;
        for (size_t i = c; i < mean.size(); i += 3) {
          if (mean[i] < static_cast<float>(kBright)) continue;
          ratios.push_back(static_cast<double>(light_.light(take[i], static_cast<int>(c)) / mean[i]));
          light += static_cast<double>(mean[i]);
        }
        if (ratios.size() < kMinRatios) return;
        light /= static_cast<double>(ratios.size());
        // 1.25: the error of a median relative to that of a mean.
        repeats.error = std::max(
            repeats.error, 1.25 * noise_at(light) / light / std::sqrt(static_cast<double>(ratios.size())));
        repeats.factors[c].push_back(median(std::move(ratios)));
      }
    }
    repeats_.push_back(std::move(repeats));
  }

  // The variance over takes beyond noise, of one channel's (or the common) factors.
  template <typename Factor>
  static double excess(const Repeats& repeats, const Factor& factor) {
    double square = 0.0, mean = 0.0;
    const auto n = static_cast<double>(repeats.takes());
    for (size_t k = 0; k < repeats.takes(); ++k) mean += factor(k) / n;
    for (size_t k = 0; k < repeats.takes(); ++k) square += std::pow(factor(k) - mean, 2) / (n - 1.0);
    return square - kSigmas * repeats.error * repeats.error;
  }

  void look_for_flicker() {
    if (repeats_.empty()) return;
    double all = 0.0;
    std::vector<double> worst(samples_.exposures_ms.size());
    for (const Repeats& repeats : repeats_) {
      const double variance = excess(repeats, [&](size_t k) { return repeats.common(k); });
      all += variance / static_cast<double>(repeats_.size());
      worst[repeats.exposure] = std::max(worst[repeats.exposure], variance);
    }
    const double rms = std::sqrt(std::max(all, 0.0));
    if (rms < kShareOfNoise * pixel_noise_) return;
    const size_t at = std::ranges::max_element(worst) - worst.begin();
    out_.push_back(fmt::format(
        "flicker: repeats of one picture differ in brightness by {:.2g} % (rms), most at {:.4g} ms "
        "({:.2g} %), where noise explains {:.2g} %; use exposures that are whole multiples of the light's "
        "period (room light: 10 ms or 8.33 ms; a dimmed backlight: its refresh), or other light",
        100.0 * rms, samples_.exposures_ms[at], 100.0 * std::sqrt(worst[at]),
        100.0 * repeats_.front().error));
  }

  // Only the first take follows a change of exposure.
  void look_for_jumps() {
    std::vector<double> jumps;
    for (const Repeats& repeats : repeats_) {
      double others = 0.0;
      for (size_t k = 1; k < repeats.takes(); ++k)
        others += repeats.common(k) / static_cast<double>(repeats.takes() - 1);
      jumps.push_back(repeats.common(0) - others);
    }
    if (jumps.size() < 4) return;
    double square = 0.0;
    for (const double jump : jumps) square += jump * jump;
    const double rms = std::sqrt(square / static_cast<double>(jumps.size()));
    size_t calm = 0;  // scatter of the later takes
    double later = 0.0;
    for (const Repeats& repeats : repeats_) {
      for (size_t k = 2; k < repeats.takes(); ++k, ++calm)
        later += std::pow(repeats.common(k) - repeats.common(1), 2);
    }
    if (calm == 0) return;
    later = std::sqrt(later / static_cast<double>(calm));
    if (rms < kOwnChange || rms < kSigmas * later) return;
    out_.push_back(fmt::format(
        "automatic exposure or gain: after each change of the exposure the first frame differs from its "
        "repeats by {:.2g} %, the repeats among themselves by {:.2g} %; turn automatic exposure and "
        "automatic gain of the camera off",
        100.0 * rms, 100.0 * later));
  }

  // The middle of a stripe is white, so it cannot be brighter than white.
  void compare_with_white(const SampledMonitor& monitor) {
    for (size_t j = 0; j < samples_.exposures_ms.size(); ++j) {
      const std::vector<float> stripe = mean_light(monitor.takes(j, Shown::kStripe), light_),
                               white = mean_light(monitor.takes(j, Shown::kWhite), light_),
                               black = mean_light(monitor.takes(j, Shown::kBlack), light_);
      std::array<std::vector<double>, 4> ratios;  // r, g, b, and their mean
      double light = 0.0;
      for (size_t i = 0; i < white.size(); i += 3) {
        double sum = 0.0;
        const auto ok = [&](size_t at) {
          return stripe[at] >= 0.0f && white[at] - black[at] > static_cast<float>(kBright);
        };
        if (!ok(i) || !ok(i + 1) || !ok(i + 2)) continue;
        for (size_t c = 0; c < 3; ++c) {
          const auto ratio =
              static_cast<double>((stripe[i + c] - black[i + c]) / (white[i + c] - black[i + c]));
          ratios[c].push_back(ratio), sum += ratio / 3.0;
        }
        light += static_cast<double>(white[i + 1]);
        ratios[3].push_back(sum);
      }
      const size_t count = ratios[3].size();
      if ((1.0 - kPeak) * static_cast<double>(count) < static_cast<double>(kMinRatios)) continue;
      light /= static_cast<double>(count);
      const double noise = noise_at(light) / light *
                           std::sqrt(2.0 / static_cast<double>(monitor.takes(j, Shown::kWhite).size()));
      std::vector<double> sorted = ratios[3];
      const auto peak = sorted.begin() + static_cast<std::ptrdiff_t>(kPeak * static_cast<double>(count));
      std::nth_element(sorted.begin(), peak, sorted.end());
      if (*peak > 1.0 + kOwnChange + 3.0 * noise) {
        out_.push_back(fmt::format(
            "automatic exposure or gain: at {:.4g} ms a stripe on monitor \"{}\" is {:.2g} % brighter than "
            "its white; turn automatic exposure and gain of the camera off, and any dimming of the monitor "
            "that depends on its picture",
            samples_.exposures_ms[j], monitor.name, 100.0 * (*peak - 1.0)));
        return;
      }
    }
  }

  struct ColourStep {
    size_t exposure = 0;  // to the next one
    std::array<double, 3> off{};
    double max() const { return std::max({std::abs(off[0]), std::abs(off[1]), std::abs(off[2])}); }
  };

  // The largest change of channels relative to each other from one exposure to the next.
  std::optional<ColourStep> largest_colour_step() const {
    std::optional<ColourStep> largest;
    for (const SampledMonitor& monitor : samples_.monitors) {
      for (const Shown shown : {Shown::kStripe, Shown::kWhite}) {
        std::vector<float> before = mean_light(monitor.takes(0, shown), light_);
        for (size_t j = 0; j + 1 < samples_.exposures_ms.size(); ++j) {
          std::vector<float> after = mean_light(monitor.takes(j + 1, shown), light_);
          std::array<std::vector<double>, 3> ratios;
          for (size_t i = 0; i < after.size(); ++i) {
            if (before[i] < static_cast<float>(kBright) || after[i] < 0.0f ||
                after[i] > static_cast<float>(kNearlyFull))
              continue;
            ratios[i % 3].push_back(std::log(static_cast<double>(after[i] / before[i])));
          }
          before = std::move(after);
          if (std::ranges::any_of(ratios, [](const auto& own) { return own.size() < kMinRatios; })) continue;
          ColourStep step{.exposure = j, .off = {median(ratios[0]), median(ratios[1]), median(ratios[2])}};
          const double mean = (step.off[0] + step.off[1] + step.off[2]) / 3.0;
          for (double& off : step.off) off -= mean;
          if (!largest || step.max() > largest->max()) largest = step;
        }
      }
    }
    return largest;
  }

  void look_for_white_balance() {
    static constexpr const char* kAdvice = "turn the camera's automatic white balance off";
    const std::optional<ColourStep> step = largest_colour_step();
    if (step && step->max() > kOwnChange) {
      out_.push_back(fmt::format(
          "automatic white balance: from {:.4g} ms to {:.4g} ms red, green and blue change by {:+.2g} %, "
          "{:+.2g} % and {:+.2g} % relative to their mean; {}",
          samples_.exposures_ms[step->exposure], samples_.exposures_ms[step->exposure + 1],
          100.0 * step->off[0], 100.0 * step->off[1], 100.0 * step->off[2], kAdvice));
      return;
    }
    double all = 0.0;
    for (const Repeats& repeats : repeats_) {
      for (size_t c = 0; c < 3; ++c) {
        const double variance =
            excess(repeats, [&](size_t k) { return repeats.factors[c][k] - repeats.common(k); });
        all += variance / static_cast<double>(3 * repeats_.size());
      }
    }
    const double rms = std::sqrt(std::max(all, 0.0));
    if (repeats_.empty() || rms < kShareOfNoise * pixel_noise_) return;
    out_.push_back(
        fmt::format("automatic white balance: repeats of one picture differ in colour by {:.2g} % (rms), "
                    "where noise explains {:.2g} %; {}",
                    100.0 * rms, 100.0 * repeats_.front().error, kAdvice));
  }

  void look_for_clipping() {
    for (const SampledMonitor& monitor : samples_.monitors) {
      size_t clipped = 0;
      for (const std::uint16_t code : monitor.takes(0, Shown::kWhite).front())
        clipped += light_.saturated(code) ? 1 : 0;
      if (static_cast<double>(clipped) > kClippedShare * static_cast<double>(monitor.sample_count())) {
        out_.push_back(fmt::format(
            "clipping: white of monitor \"{}\" is clipped in {:.0f} % of samples even at the shortest "
            "exposure, {:.4g} ms, so its brightness and the fall-off were not measured; add shorter "
            "exposures, or close the aperture",
            monitor.name, 100.0 * static_cast<double>(clipped) / static_cast<double>(monitor.sample_count()),
            samples_.exposures_ms[0]));
      }
      size_t zero = 0;
      for (const std::uint16_t code : monitor.takes(0, Shown::kBlack).front()) zero += code == 0 ? 1 : 0;
      if (static_cast<double>(zero) > kClippedShare * static_cast<double>(monitor.sample_count())) {
        out_.push_back(fmt::format(
            "clipping: {:.0f} % of the samples of black are 0, so the black level cuts off noise and "
            "dark light is overestimated; raise the camera's black level (brightness, offset; of a simulated "
            "one --black-level), or turn its noise reduction off",
            100.0 * static_cast<double>(zero) / static_cast<double>(monitor.sample_count())));
      }
    }
    for (const v1::CameraCurve& curve : calibration_.curves()) {
      if (curve.brightest_seen() >= kReaches * calibration_.saturation()) continue;
      out_.push_back(
          fmt::format("nothing is bright enough: the brightest code is {:.2f} of full scale, and the curve "
                      "above is extrapolated; add longer exposures",
                      curve.brightest_seen()));
      return;
    }
  }

  const CalibrationSamples& samples_;
  const v1::CameraCalibration& calibration_;
  const FrameLight& light_;
  const double pixel_noise_;  // noise of a pixel of light 1
  std::vector<Repeats> repeats_;
  std::vector<std::string> out_;
};

}  // namespace

absl::Status check_codes_follow(const CalibrationSamples& samples, const std::array<double, 3>& black_level,
                                double saturation) {
  const std::vector<double>& times = samples.exposures_ms;
  for (const SampledMonitor& monitor : samples.monitors) {
    for (size_t j = 0; j + 1 < times.size(); ++j) {
      const auto &before = monitor.takes(j, Shown::kStripe).front(),
                 &after = monitor.takes(j + 1, Shown::kStripe).front();
      std::vector<double> ratios;
      for (size_t i = 0; i < before.size(); ++i) {
        const double a = before[i] / 65535.0 - black_level[i % 3],
                     b = after[i] / 65535.0 - black_level[i % 3];
        if (a > kBright && b + black_level[i % 3] < kNearlyFull * saturation) ratios.push_back(b / a);
      }
      if (ratios.size() < kMinRatios || times[j + 1] < kTwoExposures * times[j]) continue;
      if (const double ratio = median(std::move(ratios)); ratio < 1.0 + kOwnChange) {
        return absl::FailedPreconditionError(
            fmt::format("codes do not follow the exposure times: frames of {:.4g} ms have codes {:.2f} times "
                        "those of {:.4g} ms, so no curve can be fitted; turn automatic exposure and "
                        "automatic gain of the camera off",
                        times[j + 1], ratio, times[j]));
      }
    }
  }
  return absl::OkStatus();
}

TimesOff times_off(const std::vector<double>& declared_ms, const std::vector<double>& fitted_s) {
  TimesOff off;
  for (size_t j = 0; j < declared_ms.size(); ++j) {
    const double ratio = 1000.0 * fitted_s[j] / declared_ms[j];
    if (std::abs(ratio - 1.0) <= off.max) continue;
    off.max = std::abs(ratio - 1.0);
    off.text = fmt::format(
        "codes do not follow the exposure times: frames of {:.4g} ms are as bright as {:.3g} ms would be",
        declared_ms[j], 1000.0 * fitted_s[j]);
  }
  return off;
}

std::vector<std::string> symptoms(const CalibrationSamples& samples, const v1::CameraCalibration& calibration,
                                  const FrameLight& light) {
  return Symptoms(samples, calibration, light).find();
}

}  // namespace glasswing
