#include "solver/mixture/mixture_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <tuple>

#include "core/base/status.h"
#include "core/footprint/matte_covariance.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kMinDirections = 3;

bool within(double value, double low, double high) {
  return value >= low && value <= high;
}

absl::Status check_numbers(const v1::Frame& frame) {
  const v1::Stimulus& stimulus = frame.stimulus();
  const bool stripe = kind_of(stimulus) == StimulusKind::kStripe;
  const double size_px = stripe ? stimulus.sigma_px() : stimulus.period_px();
  if (within(size_px, stripe ? 0.01 : 2.0, 1e6) && stimulus.peak() > 0.0 && stimulus.peak() <= 1.0 &&
      within(stimulus.phi_deg(), -1e4, 1e4) && within(stimulus.phase_deg(), -1e6, 1e6) &&
      within(stimulus.r_px(), -1e5, 1e5))
    return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("{} shows a {} of {} {} px, peak {}, at {} deg; accepted are {} to 1000000 px, (0, 1] and "
                  "+-10000 deg",
                  frame.file(), stripe ? "stripe" : "sinusoid", stripe ? "sigma" : "period", size_px,
                  stimulus.peak(), stimulus.phi_deg(), stripe ? 0.01 : 2));
}

// Nothing for a pattern that is not used.
std::optional<ShownPattern> shown(const v1::Stimulus& stimulus) {
  ShownPattern pattern;
  const double phi_rad = stimulus.phi_deg() * std::numbers::pi / 180.0;
  switch (kind_of(stimulus)) {
    case StimulusKind::kSolid:
      return pattern;
    case StimulusKind::kSquare:
      pattern.lit = {.bars = true,
                     .horizontal = stimulus.orient() == "horizontal_bars",
                     .bar_px = stimulus.bar_width_px(),
                     .offset_px = stimulus.offset_px(),
                     .inverse = stimulus.inverse()};
      // Other bars have edges within pixels.
      if (!(pattern.lit.bar_px >= 1.0) || pattern.lit.bar_px != std::round(pattern.lit.bar_px) ||
          pattern.lit.offset_px != std::round(pattern.lit.offset_px))
        return std::nullopt;
      return pattern;
    case StimulusKind::kStripe:
      pattern.kind = ShownPattern::Kind::kStripe;
      pattern.axis = {
          .cos_phi = std::cos(phi_rad), .sin_phi = std::sin(phi_rad), .sigma_px = stimulus.sigma_px()};
      pattern.r_px = stimulus.r_px();
      return pattern;
    case StimulusKind::kSinusoid:
      pattern.kind = ShownPattern::Kind::kWave;
      pattern.fx = std::cos(phi_rad) / stimulus.period_px();
      pattern.fy = std::sin(phi_rad) / stimulus.period_px();
      pattern.phase_rad = stimulus.phase_deg() * std::numbers::pi / 180.0;
      return pattern;
    default:
      return std::nullopt;
  }
}

absl::Status check_monitor(const MixtureMonitor& monitor, const std::set<double>& directions,
                           const std::string& name) {
  const auto count = std::ranges::count_if(
      monitor.patterns, [](const ShownPattern& p) { return p.kind != ShownPattern::Kind::kArea; });
  if (count < kMinPatterns || directions.size() < kMinDirections) {
    return absl::FailedPreconditionError(
        fmt::format("monitor \"{}\" showed {} stripes and sinusoids in {} directions; at least {} in {} are "
                    "needed, such as 0, 90 and 45 deg",
                    name, count, directions.size(), kMinPatterns, kMinDirections));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<MixtureLayout> lay_out_mixture(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  struct Sample {
    ShownPattern pattern;
    std::array<double, 3> peak;
    Shot shot;
  };
  // By texture; then by what was shown, sinusoids of one frequency adjacent.
  using Key = std::tuple<int, double, double, double, double, double, std::array<double, 3>>;
  std::map<int, std::map<Key, Sample>> samples;
  std::map<int, std::set<double>> directions;
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    if (!is_pattern(frame) || !frame.object()) continue;
    std::optional<ShownPattern> pattern = shown(stimulus);
    if (!pattern) continue;
    const bool area = pattern->kind == ShownPattern::Kind::kArea;
    std::array<double, 3> peak;
    for (int c = 0; c < 3; ++c) peak[c] = colour_of(stimulus, c) * (area ? 1.0 : stimulus.peak());
    if (peak == std::array<double, 3>{}) continue;  // black
    const int texture = texture_of(manifest, stimulus.panel());
    if (texture < 0) {
      return absl::FailedPreconditionError(fmt::format(
          "{} names monitor \"{}\", which the manifest does not list", frame.file(), stimulus.panel()));
    }
    if (!area) {
      GW_RETURN_IF_ERROR(check_numbers(frame));
      directions[texture].insert(std::round(1e3 * std::fmod(stimulus.phi_deg() + 720.0, 180.0)));
    }
    const LitArea& lit = pattern->lit;
    const Key key = area ? Key{lit.bars, lit.horizontal, lit.bar_px, lit.offset_px, lit.inverse, 0.0, peak}
                    : pattern->kind == ShownPattern::Kind::kStripe
                        ? Key{2, stimulus.phi_deg(), stimulus.sigma_px(), pattern->r_px, 0.0, 0.0, peak}
                        : Key{3, pattern->fx, pattern->fy, pattern->phase_rad, 0.0, 0.0, peak};
    Sample& sample = samples[texture][key];
    sample.pattern = *pattern;
    sample.peak = peak;
    sample.shot.push_back(exposures.exposed(manifest, i));
  }
  MixtureLayout layout;
  for (const auto& [texture, found] : directions) {
    const v1::Monitor& shown_on = manifest.monitors(texture);
    MixtureMonitor monitor{
        .texture = texture, .extent = extent_of(shown_on), .patterns = {}, .peaks = {}, .shots = {}};
    for (auto& [key, sample] : samples[texture]) {
      monitor.patterns.push_back(sample.pattern);
      monitor.peaks.push_back(sample.peak);
      monitor.shots.push_back(std::move(sample.shot));
    }
    GW_RETURN_IF_ERROR(check_monitor(monitor, found, shown_on.name()));
    layout.monitors.push_back(std::move(monitor));
  }
  if (layout.monitors.empty()) {
    return absl::FailedPreconditionError(
        "the archive has neither stripes (gauss_stripe) nor sinusoids (sinusoid) with the object");
  }
  layout.stage = lay_out_stage(manifest, exposures);
  layout.wave_noise = WaveNoise(manifest);
  GW_RETURN_IF_ERROR(check_black(layout.stage));
  return layout;
}

namespace {

bool has_colours(const MixtureMonitor& monitor) {
  return std::ranges::any_of(monitor.peaks, [](const std::array<double, 3>& peak) {
    return peak[0] != peak[1] || peak[0] != peak[2];
  });
}

// Runs of stripes that are evenly apart become sweeps.
void name_stripe(int texture, const ShownPattern& pattern, double light, v1::Mixture& mixture) {
  constexpr double kEven = 1e-6;  // of a step
  const double phi_deg = std::atan2(pattern.axis.sin_phi, pattern.axis.cos_phi) * 180.0 / std::numbers::pi;
  if (!mixture.sweeps().empty()) {
    v1::StripeSweep& last = *mixture.mutable_sweeps()->rbegin();
    const double step_px = pattern.r_px - last.last_r_px(),
                 before_px = (last.last_r_px() - last.first_r_px()) / std::max(last.count() - 1, 1);
    if (last.texture() == texture && last.phi_deg() == phi_deg && last.sigma_px() == pattern.axis.sigma_px &&
        last.light() == light && step_px > 0.0 &&
        (last.count() == 1 || std::abs(step_px - before_px) <= kEven * before_px)) {
      last.set_last_r_px(pattern.r_px);
      last.set_count(last.count() + 1);
      return;
    }
  }
  v1::StripeSweep& named = *mixture.add_sweeps();
  named.set_texture(texture);
  named.set_phi_deg(phi_deg);
  named.set_sigma_px(pattern.axis.sigma_px);
  named.set_first_r_px(pattern.r_px);
  named.set_last_r_px(pattern.r_px);
  named.set_count(1);
  named.set_light(light);
}

}  // namespace

void name_samples(const MixtureLayout& layout, v1::MatteMetadata& metadata) {
  if (std::ranges::any_of(layout.monitors, has_colours)) return;
  v1::Mixture& mixture = *metadata.mutable_mixture();
  for (const MixtureMonitor& monitor : layout.monitors) {
    using Kind = std::tuple<double, int>;                                    // light and pictures
    std::map<std::tuple<double, double, Kind>, std::vector<double>> phases;  // by frequency
    for (size_t i = 0; i < monitor.patterns.size(); ++i) {
      const ShownPattern& pattern = monitor.patterns[i];
      const double light = monitor.peaks[i][0];
      const int count = static_cast<int>(monitor.shots[i].size());
      switch (pattern.kind) {
        case ShownPattern::Kind::kArea:
          *metadata.add_lit_pictures() = lit_picture(monitor.texture, pattern.lit, light, count);
          break;
        case ShownPattern::Kind::kStripe:
          name_stripe(monitor.texture, pattern, light, mixture);
          break;
        case ShownPattern::Kind::kWave:
          phases[{pattern.fx, pattern.fy, {light, count}}].push_back(pattern.phase_rad * 180.0 /
                                                                     std::numbers::pi);
          break;
      }
    }
    std::map<std::pair<std::vector<double>, Kind>, v1::WaveSet*> sets;
    for (const auto& [wave, shown_phases] : phases) {
      const auto& [fx, fy, kind] = wave;
      v1::WaveSet*& set = sets[{shown_phases, kind}];
      if (set == nullptr) {
        set = mixture.add_wave_sets();
        set->set_texture(monitor.texture);
        for (const double phase_deg : shown_phases) set->add_phase_deg(phase_deg);
        set->set_light(std::get<0>(kind));
        set->set_count(std::get<1>(kind));
      }
      set->add_x_per_px(static_cast<float>(fx));
      set->add_y_per_px(static_cast<float>(fy));
    }
  }
}

std::vector<int> frames_of(const MixtureLayout& layout) {
  const std::vector<int> stage = frames_of(layout.stage);
  std::set<int> frames(stage.begin(), stage.end());
  for (const int frame : layout.wave_noise.frames()) frames.insert(frame);
  for (const MixtureMonitor& monitor : layout.monitors) {
    for (const Shot& shot : monitor.shots) {
      for (const ExposedFrame& exposed : shot) frames.insert(exposed.frame);
    }
  }
  return {frames.begin(), frames.end()};
}

}  // namespace glasswing
