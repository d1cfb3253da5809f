#include "solver/corrections/object_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <tuple>

#include "core/base/median.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr double kMaxStep = 2.0;    // sigmas from stripe to stripe, of a sweep whose sum is light
constexpr double kMaxGap = 1.5;     // usual steps
constexpr double kMaxAtGap = 0.02;  // of a sum, of one stripe beside a gap, of which more may be missing
constexpr double kLitSds = 10.0;    // standard deviations of what counts as light
constexpr double kChange = 0.1, kMinChange = 0.03;  // of a sum, and of the typical one, that is not an error
constexpr double kScatters = 6.0;                   // standard deviations
constexpr double kMinMoved = 8.0;                   // pixels, and of all:
constexpr double kMinShare = 0.002;
constexpr size_t kMinPixels = 100;
constexpr int kRim = 3;              // sampled pixels
constexpr double kGainError = 0.03;  // of frames measured by few pixels; it changes the object's own light

struct Sweep {
  std::vector<int> frames;  // by place
  std::vector<double> r_px;
  double sigma_px = 1.0;
  double scale() const { return 1.0 / (sigma_px * std::sqrt(2.0 * std::numbers::pi)); }
  std::ptrdiff_t first = 0, last = 0;  // in the order of time
};

// Stripes of one direction on one monitor, with the object, in the order of time.
std::vector<Sweep> sweeps_of(const v1::CaptureManifest& manifest, const ComparedFrames& compared,
                             const std::vector<int>& order, int texture) {
  std::map<std::tuple<double, double>, Sweep> sweeps;
  std::map<std::tuple<double, double>, std::map<double, int>> by_place;
  for (std::ptrdiff_t i = 0; i < std::ssize(order); ++i) {
    const int f = order[i];
    const v1::Stimulus& stimulus = manifest.frames(f).stimulus();
    if (!manifest.frames(f).object() || kind_of(stimulus) != StimulusKind::kStripe ||
        compared.samples.light[f].empty() || texture_of(manifest, stimulus.panel()) != texture)
      continue;
    const std::tuple key{stimulus.phi_deg(), stimulus.sigma_px()};
    if (by_place[key].empty()) sweeps[key].first = i;
    sweeps[key].last = i;
    sweeps[key].sigma_px = stimulus.sigma_px();
    by_place[key][stimulus.r_px()] = f;
  }
  std::vector<Sweep> in_order;
  for (auto& [key, sweep] : sweeps) {
    for (const auto& [r_px, f] : by_place[key]) {
      sweep.r_px.push_back(r_px);
      sweep.frames.push_back(f);
    }
    in_order.push_back(std::move(sweep));
  }
  std::ranges::sort(in_order, {}, &Sweep::first);
  return in_order;
}

float dark_of(const ComparedFrames& compared, size_t lane) {
  if (compared.layout.black.empty()) return 0.0f;
  return compared.samples.light[compared.layout.black.front().frame][lane];
}

// The light of each lane that all stripes of the sweep add up to, of white; NaN if some are missing.
std::vector<double> sums_of(const ComparedFrames& compared, const FrameCorrections* corrections,
                            const Sweep& sweep) {
  const size_t lanes = compared.samples.lane_count();
  std::vector<double> sums(lanes, NAN);
  std::vector<double> steps;
  for (size_t i = 1; i < sweep.r_px.size(); ++i) steps.push_back(sweep.r_px[i] - sweep.r_px[i - 1]);
  if (steps.size() < 2) return sums;
  std::vector<double> sorted = steps;
  const double step = median(sorted);
  if (step > kMaxStep * sweep.sigma_px) return sums;
  const double scale = sweep.scale();
  std::vector<double> at_gap(lanes, 0.0);
  std::ranges::fill(sums, 0.0);
  for (size_t i = 0; i < sweep.frames.size(); ++i) {
    const double before = i > 0 ? steps[i - 1] : INFINITY, after = i < steps.size() ? steps[i] : INFINITY;
    const double share = 0.5 * scale * (std::min(before, kMaxGap * step) + std::min(after, kMaxGap * step));
    const bool gap = std::max(before, after) > kMaxGap * step;
    const size_t f = sweep.frames[i];
    const FrameCorrection correction = corrections == nullptr ? FrameCorrection{} : corrections->of_frame[f];
    const std::vector<float>& lights = compared.samples.light[f];
    for (size_t lane = 0; lane < lanes; ++lane) {
      const size_t c = compared.samples.channel[lane];
      const double light = static_cast<double>(
          (lights[lane] - dark_of(compared, lane) - correction.offset[c]) / correction.gain[c]);
      sums[lane] += share * light;
      if (gap) at_gap[lane] = std::max(at_gap[lane], light);
    }
  }
  const double noise = 4.0 * compared.noise_sd;
  for (size_t lane = 0; lane < lanes; ++lane) {
    if (at_gap[lane] * scale * step > kMaxAtGap * sums[lane] + noise * scale * step) sums[lane] = NAN;
  }
  return sums;
}

// Pixels that see an id patch, whose light follows the steps' numbers and not the stripes.
std::vector<bool> sees_patch(const ComparedFrames& compared) {
  constexpr float kSeen = 6.0f;  // standard deviations
  const SessionSamples& samples = compared.samples;
  std::vector<bool> sees(samples.pixels.size());
  for (const std::vector<int>& patches : compared.layout.patches) {
    for (size_t lane = 0; lane < samples.lane_count(); ++lane) {
      float low = INFINITY, high = -INFINITY;
      for (const int f : patches) {
        const std::vector<float>& lights = samples.light[f];
        if (lights.empty()) continue;
        low = std::min(low, lights[lane]), high = std::max(high, lights[lane]);
      }
      if (high - low > kSeen * static_cast<float>(compared.noise_sd)) sees[samples.pixel_of(lane)] = true;
    }
  }
  return sees;
}

// By pixel, averaged over its lanes.
std::vector<double> of_pixels(const SessionSamples& samples, const std::vector<double>& sums) {
  const size_t lanes = samples.lanes_per_pixel;
  std::vector<double> means(samples.pixels.size(), 0.0);
  for (size_t lane = 0; lane < sums.size(); ++lane)
    means[samples.pixel_of(lane)] += sums[lane] / static_cast<double>(lanes);
  return means;
}

// Pixels of the object, and those within kRim of one, in rows and columns of samples.
std::vector<bool> at_object(const SessionSamples& samples, const std::vector<bool>& beside) {
  const auto columns = static_cast<int>(
      std::ranges::count(samples.pixels, samples.pixels.front().y, &SessionSamples::Pixel::y));
  const int rows = static_cast<int>(samples.pixels.size()) / columns;
  std::vector<bool> at(beside.size());
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      if (beside[j * columns + i]) continue;
      for (int y = std::max(j - kRim, 0); y <= std::min(j + kRim, rows - 1); ++y) {
        for (int x = std::max(i - kRim, 0); x <= std::min(i + kRim, columns - 1); ++x)
          at[y * columns + x] = true;
      }
    }
  }
  return at;
}

struct Moved {
  size_t pixels = 0, of = 0;
  size_t elsewhere = 0;  // of the pixels: not at the object, which it cannot change
};

// `errors`: of the change of each pixel's light; `at`: whether it is the object's, or close to it.
Moved moved_between(const std::vector<double>& first, const std::vector<double>& own,
                    const std::vector<double>& errors, const std::vector<bool>& at) {
  std::vector<double> changes;
  for (size_t i = 0; i < first.size(); ++i) {
    if (!std::isnan(first[i] + own[i])) changes.push_back(std::abs(own[i] - first[i]));
  }
  const double lit = kLitSds * 1.4826 * median(changes);
  std::vector<double> ratios, lights;
  for (size_t i = 0; i < first.size(); ++i) {
    if (!(first[i] > lit && own[i] > lit)) continue;
    ratios.push_back(own[i] / first[i]);
    lights.push_back(first[i]);
  }
  if (ratios.size() < kMinPixels) return {};
  const double usual = median(ratios), light = median(lights);
  const auto change_of = [&](size_t i) { return std::abs(own[i] / usual - first[i]) - errors[i]; };
  changes.clear();
  for (size_t i = 0; i < first.size(); ++i) {
    if (!std::isnan(first[i] + own[i])) changes.push_back(change_of(i));
  }
  const size_t of = changes.size();
  const double scatter = 1.4826 * median(changes);
  Moved moved{.of = of};
  for (size_t i = 0; i < first.size(); ++i) {
    if (!(change_of(i) >
          std::max({kChange * std::max(own[i] / usual, first[i]), kMinChange * light, kScatters * scatter})))
      continue;
    ++moved.pixels;
    moved.elsewhere += !at[i];
  }
  return moved;
}

}  // namespace

std::string object_motion_warning(const v1::CaptureManifest& manifest, const ComparedFrames& compared,
                                  const std::vector<int>& order, const FrameCorrections* corrections) {
  // Only light is additive.
  if (!manifest.has_camera_calibration() && manifest.camera().response() == "unknown") return "";
  if (compared.layout.bare) return "";
  const std::vector<bool> at = at_object(compared.samples, compared.beside), patch = sees_patch(compared);
  for (const EmptyMonitor& monitor : compared.layout.monitors) {
    const std::vector<Sweep> sweeps = sweeps_of(manifest, compared, order, monitor.texture);
    if (sweeps.size() < 2) continue;
    const auto light_of = [&](const Sweep& sweep) {
      std::vector<double> light = of_pixels(compared.samples, sums_of(compared, corrections, sweep));
      for (size_t i = 0; i < light.size(); ++i) {
        if (patch[i]) light[i] = NAN;
      }
      return light;
    };
    const std::vector<double> first = light_of(sweeps.front());
    std::vector<double> errors(compared.samples.lane_count(), 0.0);
    const double stripes =
        (sweeps.front().r_px.back() - sweeps.front().r_px.front()) * sweeps.front().scale();
    for (size_t lane = 0; corrections != nullptr && lane < errors.size(); ++lane)
      errors[lane] = kGainError * stripes * dark_of(compared, lane);
    errors = of_pixels(compared.samples, errors);
    for (size_t k = 1; k < sweeps.size(); ++k) {
      const Moved moved = moved_between(first, light_of(sweeps[k]), errors, at);
      if (2 * moved.elsewhere > moved.pixels) continue;  // light on a part of the picture
      if (static_cast<double>(moved.pixels) < std::max(kMinMoved, kMinShare * static_cast<double>(moved.of)))
        continue;
      return fmt::format(
          "the object or the camera moved before frame {}: {} of {} pixels no longer see as much light as in "
          "the first sweep; recapture from frame {}",
          order[sweeps[k].last], moved.pixels, moved.of, order[sweeps[k - 1].first]);
    }
  }
  return "";
}

}  // namespace glasswing
