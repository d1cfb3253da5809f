#include "solver/background/stage_maps.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>

#include "core/base/status.h"
#include "core/footprint/footprint.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/background/stage_layout.h"

namespace glasswing {
namespace {

constexpr int kMaxRows = 32, kMaxColumns = 96;  // the maximum that are examined
constexpr size_t kMinSteps = 5;                 // of a sweep
constexpr double kMinSd_px = 0.02;              // of a sighting: footprints are not quite Gaussian
constexpr double kMaxFinestBar_px = 2.0;
constexpr double kTolerance = 0.01;      // of the silhouette: drifting light is not an object
constexpr double kMinPeak = 10.0;        // standard deviations of a sample
constexpr int kRefits = 2;               // of fits after the first
constexpr double kMaxPlaceSd_px = 0.75;  // quantisation by flat pixels is 0.29
constexpr double kMaxSd_px = 0.3;        // of the map
constexpr double kMinSeen = 0.01;        // of the pixels
constexpr double kMaxStrained = 0.3, kWarnStrained = 0.01;  // of the pixels that see the monitor

// A stripe that travelled over a monitor.
struct StageSweep {
  bool object = false;  // on the stage
  double cos_phi = 1.0, sin_phi = 0.0, sigma_px = 0.0;
  std::vector<double> r_px;  // ascends
  std::vector<int> frames;
};

// By texture.
std::vector<std::vector<StageSweep>> lay_out_sweeps(const v1::CaptureManifest& manifest,
                                                    const std::vector<int>& frames) {
  using Key = std::tuple<int, double, double, bool>;      // texture, phi, sigma, object
  using Light = std::tuple<double, double, std::string>;  // exposure, peak, colour
  std::map<Key, std::map<Light, std::map<double, int>>> found;
  for (const int i : frames) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    const int texture = texture_of(manifest, stimulus.panel());
    if (!is_pattern(frame) || texture < 0) continue;
    if (kind_of(stimulus) != StimulusKind::kStripe || !(stimulus.sigma_px() > 0.0)) continue;
    const std::string colour = fmt::format("{}", fmt::join(stimulus.colour(), " "));
    found[{texture, stimulus.phi_deg(), stimulus.sigma_px(), frame.object()}]
         [{frame.exposure_ms(), stimulus.peak(), colour}]
             .emplace(stimulus.r_px(), i);
  }
  std::vector<std::vector<StageSweep>> sweeps(manifest.monitors_size());
  for (const auto& [key, lights] : found) {
    const auto& [texture, phi_deg, sigma_px, object] = key;
    const auto most =
        std::ranges::max_element(lights, {}, [](const auto& entry) { return entry.second.size(); });
    if (most->second.size() < kMinSteps) continue;
    StageSweep& sweep = sweeps[texture].emplace_back();
    sweep.object = object;
    sweep.cos_phi = std::cos(phi_deg * std::numbers::pi / 180.0);
    sweep.sin_phi = std::sin(phi_deg * std::numbers::pi / 180.0);
    sweep.sigma_px = sigma_px;
    for (const auto& [r_px, frame] : most->second) {
      sweep.r_px.push_back(r_px);
      sweep.frames.push_back(frame);
    }
  }
  return sweeps;
}

// A position on the monitor as flat pixels show it.
struct Shown {
  double x_px = 0.0, y_px = 0.0;  // of the camera's pixel, in the picture
  double cos_phi = 1.0, sin_phi = 0.0;
  double position_px = 0.0, noise_sd_px = 0.0;
  double sd_px = 0.0;  // with what else the usual pixel of its source is off by
  size_t source = 0;   // bars along x, along y, or one of the sweeps
};

struct LookedAt {
  double x_px = 0.0, y_px = 0.0;
  EmptyPixel pixel;
};

// One monitor, while rows are examined and afterwards.
class MapFinder {
 public:
  MapFinder(const v1::CaptureManifest& manifest, const EmptyMonitor& monitor, std::vector<StageSweep> sweeps)
      : manifest_(manifest),
        monitor_(monitor),
        sweeps_(std::move(sweeps)),
        noise_(sample_noise(manifest.camera(), kUsualNoise)),
        background_(monitor, noise_, shape_of(manifest.camera()).channels) {}

  int texture() const { return monitor_.texture; }
  bool has_evidence() const {
    return !sweeps_.empty() || !monitor_.bars[0].empty() || !monitor_.bars[1].empty();
  }

  // `changed`: by the object.
  void look(const FrameStack& row, int x, bool changed) {
    ++looks_;
    EmptyPixel pixel;
    gather(row, monitor_, x, 0, pixel);
    const double x_px = x + 0.5, y_px = row.first_row + 0.5;
    const BackgroundPoint point =
        background_.point(pixel, straight_view(manifest_.camera(), monitor_, x, row.first_row));
    if (!point.seen) return;
    for (size_t axis = 0; axis < 2; ++axis) {
      if (point.measured[axis] && !point.ambiguous) see_bars(point.axis[axis], axis, x_px, y_px);
    }
    for (size_t s = 0; s < sweeps_.size(); ++s) {
      if (!changed || !sweeps_[s].object) see_sweep(row, x, s);
    }
    looked_at_.push_back({.x_px = x_px, .y_px = y_px, .pixel = std::move(pixel)});
  }

  struct Found {
    std::optional<SmoothStage> map;
    std::string warning;
  };
  Found find() {
    const std::string& name = manifest_.monitors(monitor_.texture).name();
    const auto refused = [&](const std::string& why) {
      return Found{
          .map = std::nullopt,
          .warning = fmt::format("the background on monitor \"{}\" is taken from each pixel's own bars, not "
                                 "from one smooth surface: {}",
                                 name, why)};
    };
    // Such as a monitor at the side, whose edge the camera sees.
    if (static_cast<double>(looked_at_.size()) < kMinSeen * looks_) return {};
    StageMap::Fitted fitted = fit(std::nullopt);
    double place_sd_px = 0.0;
    for (int round = 0; round < kRefits && fitted.map; ++round) {
      fitted.map->set_spot_px2(spot_on(*fitted.map));
      place_sd_px = scale_errors(*fitted.map);
      const double spot_px2 = fitted.map->spot_px2();
      fitted = fit(fitted.map);
      if (fitted.map) fitted.map->set_spot_px2(spot_px2);
    }
    if (!fitted.map) return refused(fitted.refused);
    if (place_sd_px > kMaxPlaceSd_px)
      return refused(std::isfinite(place_sd_px)
                         ? fmt::format("pixels deviate from it by {:.1f} px", place_sd_px)
                         : "no pixels show how far they deviate from it");
    const double sd_px = rms_sd_px(*fitted.map);
    if (sd_px > kMaxSd_px) return refused(fmt::format("it would be known only to {:.1f} px", sd_px));
    SmoothStage map{.map = *std::move(fitted.map), .sd_px = sd_px, .place_sd_px = place_sd_px, .wave_sd = {}};
    map.wave_sd = usual_misses(map.map);
    const double strained = strained_share(map);
    if (strained > kMaxStrained)
      return refused(fmt::format("the bars contradict it in {:.0f} % of the pixels", 100.0 * strained));
    std::string warning;
    if (strained > kWarnStrained) {
      warning = fmt::format(
          "{:.0f} % of the background on monitor \"{}\" does not lie on the smooth surface of the rest; "
          "those "
          "pixels keep the positions from their own bars",
          100.0 * strained, name);
    }
    return {.map = std::move(map), .warning = std::move(warning)};
  }

 private:
  void see_bars(const AxisFit& fit, size_t axis, double x_px, double y_px) {
    // Coarser ones do not determine most pixels, and all those at an edge share the same error.
    if (monitor_.bars[axis].back().width_px > kMaxFinestBar_px) return;
    const double position_px = seen_through_pixels(fit.centre_px, fit.sigma_px * fit.sigma_px).centre_px;
    shown_.push_back({.x_px = x_px,
                      .y_px = y_px,
                      .cos_phi = axis == 0 ? 1.0 : 0.0,
                      .sin_phi = axis == 0 ? 0.0 : 1.0,
                      .position_px = position_px,
                      .noise_sd_px = std::max(fit.centre_sd_px, kMinSd_px),
                      .sd_px = std::max(fit.centre_sd_px, kMinSd_px),
                      .source = axis});
  }

  void see_sweep(const FrameStack& row, int x, size_t s) {
    const StageSweep& sweep = sweeps_[s];
    std::vector<double> light;
    for (const int frame : sweep.frames) {
      double sum = 0.0;
      for (const int c : row.channels(x, 0)) {
        if (row.rows[frame][row.sample_index(x, 0, c)] >= kSaturatedCode) return;
        sum += static_cast<double>(row.at(frame, x, 0, c));
      }
      light.push_back(sum);
    }
    const double channels = row.samples_per_pixel();
    const SweepPeak peak = find_sweep_peak(sweep.r_px, light, sweep.sigma_px);
    const double sd = std::sqrt(channels * noise_.variance(peak.height / (2.0 * channels)));
    if (!peak.found || peak.height < kMinPeak * sd) return;
    shown_.push_back({.x_px = x + 0.5,
                      .y_px = row.first_row + 0.5,
                      .cos_phi = sweep.cos_phi,
                      .sin_phi = sweep.sin_phi,
                      .position_px = peak.centre_px,
                      .noise_sd_px = std::hypot(sd * peak.centre_sd_px, kMinSd_px),
                      .sd_px = std::hypot(sd * peak.centre_sd_px, kMinSd_px),
                      .source = 2 + s});
  }

  // The position of the footprint on the map as flat pixels show it, minus its true position, along a
  // direction.
  static double shown_shift_px(const StagePoint& place, const Shown& own) {
    const Footprint shown = seen_through_pixels({.weight = 1.0,
                                                 .x_px = place.x_px,
                                                 .y_px = place.y_px,
                                                 .xx_px2 = place.xx_px2,
                                                 .xy_px2 = place.xy_px2,
                                                 .yy_px2 = place.yy_px2});
    return own.cos_phi * (shown.x_px - place.x_px) + own.sin_phi * (shown.y_px - place.y_px);
  }

  Sighting sighting(const Shown& own, const std::optional<StageMap>& before) const {
    Sighting sighting{.x_px = own.x_px,
                      .y_px = own.y_px,
                      .cos_phi = own.cos_phi,
                      .sin_phi = own.sin_phi,
                      .position_px = own.position_px,
                      .sd_px = own.sd_px};
    if (before) sighting.position_px -= shown_shift_px(before->at(own.x_px, own.y_px), own);
    return sighting;
  }

  StageMap::Fitted fit(const std::optional<StageMap>& before) const {
    std::vector<Sighting> sightings;
    sightings.reserve(shown_.size());
    for (const Shown& own : shown_) sightings.push_back(sighting(own, before));
    return StageMap::fit(sightings, manifest_.camera().width_px(), manifest_.camera().height_px());
  }

  // Bars and every sweep may be less exact than declared, each by a different factor. Returns how far pixels
  // deviate from the map, beyond noise, by the most sensitive of them.
  double scale_errors(const StageMap& map) {
    std::map<size_t, std::vector<double>> misses_px, misses_sd;
    for (const Shown& own : shown_) {
      const StagePoint place = map.at(own.x_px, own.y_px);
      const double miss_px =
          sighting(own, map).position_px - own.cos_phi * place.x_px - own.sin_phi * place.y_px;
      misses_px[own.source].push_back(std::abs(miss_px));
      misses_sd[own.source].push_back(std::abs(miss_px) / own.noise_sd_px);
    }
    double place_sd_px = INFINITY;
    std::map<size_t, double> factor;
    for (auto& [source, values] : misses_sd) {
      const double own = factor[source] = std::max(sd_by_median(values), 1.0);
      const double sd_px = sd_by_median(misses_px[source]);
      if (std::ssize(values) < StageMap::kMinSightings) continue;
      place_sd_px = std::min(place_sd_px, sd_px * std::sqrt(1.0 - 1.0 / (own * own)));
    }
    for (Shown& own : shown_) own.sd_px = own.noise_sd_px * factor[own.source];
    return place_sd_px;
  }

  // The spot that the bars of all pixels together fit best.
  double spot_on(StageMap map) const {
    constexpr double kBox = 1.0 / 12.0;  // of a spot as wide as a pixel: no more than a guess
    std::vector<std::pair<const LookedAt*, BackgroundMap::Waves>> some;
    for (size_t i = 0; i < looked_at_.size(); i += looked_at_.size() / kSpotPixels + 1)
      some.emplace_back(&looked_at_[i], background_.waves_of(looked_at_[i].pixel));
    double best = 0.0, least = INFINITY;  // of log(spot / box)
    const auto consider = [&](double log_spot) {
      map.set_spot_px2(kBox * std::exp(log_spot));
      double sum = std::pow(log_spot / kLogSpotSd, 2.0);
      for (const auto& [looked, waves] : some)
        sum += capped_chi_square(background_.misses(waves, map.at(looked->x_px, looked->y_px)));
      if (sum < least) best = log_spot, least = sum;
    };
    for (double log_spot = -3.0; log_spot <= 3.0; log_spot += 1.0) consider(log_spot);
    for (const double step : {0.5, 0.25}) {
      const double middle = best;
      for (const double log_spot : {middle - step, middle + step}) {
        if (std::abs(log_spot) <= 3.0) consider(log_spot);
      }
    }
    return kBox * std::exp(best);
  }

  static double capped_chi_square(const BackgroundMap::Misses& misses) {
    double chi_square = 0.0, count = 0.0;
    for (const auto& axis : misses) {
      for (const BackgroundMap::Miss& miss : axis) {
        chi_square += miss.value * miss.value / (miss.sd * miss.sd + kVError * kVError);
        count += 1.0;
      }
    }
    return std::min(chi_square, kMaxMiss * count);
  }

  double rms_sd_px(const StageMap& map) const {
    double variance = 0.0;
    for (const LookedAt& looked : looked_at_) variance += std::pow(map.sd_px(looked.x_px, looked.y_px), 2.0);
    return std::sqrt(variance / static_cast<double>(looked_at_.size()));
  }

  std::array<std::vector<double>, 2> usual_misses(const StageMap& map) const {
    std::array<std::vector<std::vector<double>>, 2> sizes;
    for (size_t axis = 0; axis < 2; ++axis) sizes[axis].resize(monitor_.bars[axis].size());
    for (const LookedAt& looked : looked_at_) {
      const auto misses = background_.misses(looked.pixel, map.at(looked.x_px, looked.y_px));
      for (size_t axis = 0; axis < 2; ++axis) {
        for (size_t level = 0; level < misses[axis].size(); ++level)
          sizes[axis][level].push_back(std::abs(misses[axis][level].value));
      }
    }
    std::array<std::vector<double>, 2> usual;
    for (size_t axis = 0; axis < 2; ++axis) {
      for (std::vector<double>& values : sizes[axis]) usual[axis].push_back(sd_by_median(values));
    }
    return usual;
  }

  double strained_share(const SmoothStage& map) const {
    double strained = 0.0;
    for (const LookedAt& looked : looked_at_)
      strained += background_.refutes(background_.point_on(map, looked.pixel, looked.x_px, looked.y_px));
    return strained / static_cast<double>(looked_at_.size());
  }

  static constexpr size_t kSpotPixels = 1000;
  static constexpr double kLogSpotSd = 1.0;
  static constexpr double kVError = 0.05;    // of v: footprints are not quite Gaussian
  static constexpr double kMaxMiss = 100.0;  // of chi-square over degrees: pixels that look elsewhere

  const v1::CaptureManifest& manifest_;
  const EmptyMonitor& monitor_;
  const std::vector<StageSweep> sweeps_;
  const SampleNoise noise_;
  const BackgroundMap background_;
  int looks_ = 0;
  std::vector<LookedAt> looked_at_;  // pixels that see the monitor
  std::vector<Shown> shown_;
};

}  // namespace

SweepPeak find_sweep_peak(std::span<const double> r_px, std::span<const double> y, double sigma_px) {
  SweepPeak peak;
  const size_t top = std::ranges::max_element(y) - y.begin();
  const double low = *std::ranges::min_element(y);
  const double from_px = r_px[top] - 3.5 * sigma_px, to_px = r_px[top] + 3.5 * sigma_px;
  // A peak at an end may lie beyond it.
  if (top == 0 || top + 1 == y.size()) return peak;
  Eigen::Vector4d at(low, y[top] - low, r_px[top], sigma_px);  // b, a, t, s
  Eigen::Matrix4d normal;
  for (int round = 0; round < 20; ++round) {
    normal.setZero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    size_t count = 0;
    for (size_t i = 0; i < y.size(); ++i) {
      if (r_px[i] < from_px || r_px[i] > to_px) continue;
      const double z = (r_px[i] - at[2]) / at[3], g = std::exp(-0.5 * z * z);
      const Eigen::Vector4d row(1.0, g, at[1] * g * z / at[3], at[1] * g * z * z / at[3]);
      normal += row * row.transpose();
      right += (y[i] - at[0] - at[1] * g) * row;
      ++count;
    }
    if (count < kMinSteps) return peak;
    const Eigen::LDLT<Eigen::Matrix4d> solver(normal);
    const Eigen::Vector4d step = solver.solve(right);
    if (!step.allFinite() || !(solver.rcond() > 1e-15)) return peak;
    at += step;
    if (!(at[1] > 0.0) || !(at[3] > 0.3 * sigma_px && at[3] < 3.0 * sigma_px)) return peak;
    if (std::abs(at[2] - r_px[top]) > 2.0 * sigma_px) return peak;
    if (std::abs(step[2]) < 1e-4 * sigma_px && std::abs(step[3]) < 1e-4 * sigma_px) {
      peak = {.found = true,
              .centre_px = at[2],
              .centre_sd_px = std::sqrt(normal.inverse()(2, 2)),
              .height = at[1]};
      return peak;
    }
  }
  return peak;
}

absl::StatusOr<StageMaps> measure_stage_maps(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const LightReader& read) {
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  const StageLayout layout = lay_out_stage(manifest, exposures);
  const std::vector<EmptyMonitor>& monitors = layout.monitors;
  std::vector<std::vector<StageSweep>> sweeps = lay_out_sweeps(manifest, frames);
  const std::vector<int> solids_and_bars = frames_of(layout);
  std::set<int> seen(solids_and_bars.begin(), solids_and_bars.end());
  for (const std::vector<StageSweep>& of_monitor : sweeps) {
    for (const StageSweep& sweep : of_monitor) seen.insert(sweep.frames.begin(), sweep.frames.end());
  }
  StageMaps maps;
  maps.of_monitor.resize(monitors.size());
  std::vector<MapFinder> finders;
  for (size_t m = 0; m < monitors.size(); ++m) {
    MapFinder finder(manifest, monitors[m], std::move(sweeps[m]));
    if (finder.has_evidence()) finders.push_back(std::move(finder));
  }
  // Without pairs every pixel counts as the object.
  if (finders.empty() || (layout.pairs.empty() && !layout.bare)) return maps;
  const std::vector<int> needed(seen.begin(), seen.end());
  const SilhouetteTest silhouette(kTolerance);
  const SampleNoise noise = sample_noise(manifest.camera(), kUsualNoise);
  const int width = manifest.camera().width_px(), height = manifest.camera().height_px();
  const int rows = std::min(kMaxRows, height), columns = std::min(kMaxColumns, width);
  for (int k = 0; k < rows; ++k) {
    GW_ASSIGN_OR_RETURN(const FrameStack row, read((2 * k + 1) * height / (2 * rows), needed));
    for (int i = 0; i < columns; ++i) {
      const int x = (2 * i + 1) * width / (2 * columns);
      const bool changed = changed_by_object(row, layout, silhouette, noise, x, 0);
      for (MapFinder& finder : finders) finder.look(row, x, changed);
    }
  }
  for (MapFinder& finder : finders) {
    MapFinder::Found found = finder.find();
    maps.of_monitor[finder.texture()] = std::move(found.map);
    if (!found.warning.empty()) maps.warnings.push_back(std::move(found.warning));
  }
  return maps;
}

}  // namespace glasswing
