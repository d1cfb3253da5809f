#include "solver/fringe/fringe_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

// A frequency below this is 0: half a turn along the longest possible side of a monitor.
constexpr double kNoFrequency = 1e-9;
constexpr double kSamePhase_rad = 1e-6;
constexpr size_t kMaxWaves = 64;

bool oblique(const Wave& wave) {
  return wave.fx != 0.0 && wave.fy != 0.0;
}

double frequency_of(const Wave& wave) {
  return std::hypot(wave.fx, wave.fy);
}

absl::Status check_sinusoid(const v1::Frame& frame) {
  const v1::Stimulus& stimulus = frame.stimulus();
  const auto in = [](double value, double low, double high) { return value >= low && value <= high; };
  if (in(stimulus.period_px(), 2.0, 1e6) && stimulus.peak() > 0.0 && stimulus.peak() <= 1.0 &&
      in(stimulus.phi_deg(), -1e4, 1e4) && in(stimulus.phase_deg(), -1e6, 1e6)) {
    return absl::OkStatus();
  }
  return absl::FailedPreconditionError(fmt::format(
      "{} shows a sinusoid of period {} px, peak {}, {} deg, phase {} deg; accepted are 2 to "
      "1000000, (0, 1], +-10000 and +-1000000",
      frame.file(), stimulus.period_px(), stimulus.peak(), stimulus.phi_deg(), stimulus.phase_deg()));
}

// Stimuli that differ only in phase.
struct Key {
  int texture;
  double phi_deg, period_px;
  std::array<double, 3> peak;
  auto operator<=>(const Key&) const = default;
};

using Waves = std::map<Key, Wave>;

void add_phase(Wave& wave, double phase_rad, const ExposedFrame& frame) {
  for (size_t i = 0; i < wave.phase_rad.size(); ++i) {
    if (std::abs(std::remainder(wave.phase_rad[i] - phase_rad, 2.0 * std::numbers::pi)) < kSamePhase_rad)
      return wave.shots[i].push_back(frame);
  }
  wave.phase_rad.push_back(phase_rad);
  wave.shots.push_back({frame});
}

void add_solid(std::vector<Solid>& solids, const std::array<double, 3>& light, const ExposedFrame& frame) {
  const auto known = std::ranges::find(solids, light, &Solid::light);
  if (known != solids.end()) return known->shot.push_back(frame);
  solids.push_back({.light = light, .shot = {frame}});
}

// By texture.
std::map<int, WaveMonitor> monitors_of(const v1::CaptureManifest& manifest, const Waves& waves) {
  std::map<int, WaveMonitor> monitors;
  for (const auto& [key, wave] : waves) {
    WaveMonitor& monitor = monitors[key.texture];
    monitor.texture = key.texture;
    monitor.extent = extent_of(manifest.monitors(key.texture));
    monitor.waves.push_back(wave);
  }
  for (auto& [texture, monitor] : monitors) {
    std::ranges::stable_sort(monitor.waves, [](const Wave& a, const Wave& b) {
      return std::tuple(oblique(a), frequency_of(a)) < std::tuple(oblique(b), frequency_of(b));
    });
  }
  return monitors;
}

void add_bars(WaveMonitor& monitor, const v1::Stimulus& stimulus, const std::array<double, 3>& light,
              const ExposedFrame& frame) {
  std::vector<Bars>& bars = monitor.bars[stimulus.orient() == "horizontal_bars" ? 1 : 0];
  const auto known = std::ranges::find_if(bars, [&](const Bars& each) {
    return each.bar_px == stimulus.bar_width_px() && each.offset_px == stimulus.offset_px() &&
           each.light == light;
  });
  Bars& own = known != bars.end() ? *known : bars.emplace_back();
  own.bar_px = stimulus.bar_width_px();
  own.offset_px = stimulus.offset_px();
  own.light = light;
  (stimulus.inverse() ? own.complement : own.lit).push_back(frame);
}

// Whether bars differ between all places of the monitor that are whole periods apart.
bool bars_tell_periods(const std::vector<Bars>& bars, double period_px, double side_px) {
  const auto code_at = [&](double at_px) {
    std::vector<bool> code;
    for (const Bars& each : bars) code.push_back(each.inside_px(at_px) > 0.0);
    return code;
  };
  if (bars.empty()) return false;
  constexpr int kPlaces = 16;  // in a period, beside the edges
  for (int place = 0; place < kPlaces; ++place) {
    std::set<std::vector<bool>> codes;
    for (double at_px = (place + 0.5) / kPlaces * period_px; at_px < side_px; at_px += period_px) {
      if (!codes.insert(code_at(at_px)).second) return false;
    }
  }
  return true;
}

// Whether the phases of all waves along an axis, whose longest has this period, differ between places that
// are whole periods of it apart.
bool waves_tell_periods(const std::vector<double>& frequencies, double period_px, double side_px) {
  constexpr double kLeastApart = 0.05;  // of a turn
  for (double apart_px = period_px; apart_px < side_px; apart_px += period_px) {
    double squared = 0.0;
    for (const double f : frequencies) squared += std::pow(std::remainder(f * apart_px, 1.0), 2);
    if (squared < kLeastApart * kLeastApart) return false;
  }
  return true;
}

absl::Status check_monitor(const WaveMonitor& monitor, const std::string& name) {
  if (monitor.waves.size() > kMaxWaves) {
    return absl::FailedPreconditionError(
        fmt::format("monitor \"{}\" showed {} different sinusoids; at most {} can be solved", name,
                    monitor.waves.size(), kMaxWaves));
  }
  for (const Wave& wave : monitor.waves) {
    if (wave.shots.size() < 3) {
      return absl::FailedPreconditionError(
          fmt::format("the sinusoid of period {:.6g} px on monitor \"{}\" was shown at {} phases; at least 3 "
                      "are needed",
                      1.0 / frequency_of(wave), name, wave.shots.size()));
    }
  }
  for (const bool along_x : {true, false}) {
    const double side_px = along_x ? monitor.extent.width_px : monitor.extent.height_px;
    std::vector<double> frequencies;
    for (const Wave& wave : monitor.waves) {
      if (!oblique(wave) && (wave.fx != 0.0) == along_x) frequencies.push_back(frequency_of(wave));
    }
    const double longest_px = frequencies.empty() ? 0.0 : 1.0 / std::ranges::min(frequencies);
    const std::vector<Bars>& bars = monitor.bars[along_x ? 0 : 1];
    const bool told =
        longest_px >= side_px * (1.0 - 1e-9) ||
        (longest_px > 0.0 && (bars.empty() ? waves_tell_periods(frequencies, longest_px, side_px)
                                           : bars_tell_periods(bars, longest_px, side_px)));
    if (!told) {
      return absl::FailedPreconditionError(fmt::format(
          "the longest sinusoid along {} on monitor \"{}\" has a period of {:.6g} px; to tell one "
          "period from the next it must be at least {:.6g}, or square waves or the phases of finer sinusoids "
          "must differ wherever it is alike",
          along_x ? "x" : "y", name, longest_px, side_px));
    }
  }
  return absl::OkStatus();
}

}  // namespace

double Bars::inside_px(double at_px) const {
  const double middle_px = offset_px + 0.5 * bar_px;
  return 0.5 * bar_px - std::abs(std::remainder(at_px - middle_px, 2.0 * bar_px));
}

absl::StatusOr<FringeLayout> lay_out_fringes(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  FringeLayout layout;
  std::array<Waves, 2> waves;  // without the object, with it
  std::array<std::map<int, std::vector<Solid>>, 2> solids;
  std::map<int, WaveMonitor> bars;  // with the object, by texture
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    const bool wave = kind_of(stimulus) == StimulusKind::kSinusoid,
               square = kind_of(stimulus) == StimulusKind::kSquare && frame.object();
    if (!is_pattern(frame) || (!wave && !square && kind_of(stimulus) != StimulusKind::kSolid)) continue;
    const int texture = texture_of(manifest, stimulus.panel());
    if (texture < 0) {
      return absl::FailedPreconditionError(fmt::format(
          "{} names monitor \"{}\", which the manifest does not list", frame.file(), stimulus.panel()));
    }
    const size_t with = frame.object() ? 1 : 0;
    std::array<double, 3> light;
    for (int c = 0; c < 3; ++c) light[c] = colour_of(stimulus, c) * (wave ? stimulus.peak() : 1.0);
    const ExposedFrame exposed = exposures.exposed(manifest, i);
    if (square) {
      if (stimulus.bar_width_px() >= 1.0 && std::isfinite(stimulus.offset_px()))
        add_bars(bars[texture], stimulus, light, exposed);
      continue;
    }
    if (!wave) {
      const bool black = light == std::array<double, 3>{};
      if (!black) add_solid(solids[with][texture], light, exposed);
      if (black && !frame.object()) layout.empty_black.push_back(exposed);
      continue;
    }
    GW_RETURN_IF_ERROR(check_sinusoid(frame));
    const double phi_rad = stimulus.phi_deg() * std::numbers::pi / 180.0;
    Wave& own = waves[with][{texture, stimulus.phi_deg(), stimulus.period_px(), light}];
    own.fx = std::cos(phi_rad) / stimulus.period_px();
    own.fy = std::sin(phi_rad) / stimulus.period_px();
    if (std::abs(own.fx) < kNoFrequency) own.fx = 0.0;
    if (std::abs(own.fy) < kNoFrequency) own.fy = 0.0;
    own.peak = light;
    add_phase(own, stimulus.phase_deg() * std::numbers::pi / 180.0, exposed);
  }
  if (waves[1].empty()) {
    return absl::FailedPreconditionError("the archive has no sinusoids (kind sinusoid, with the object)");
  }
  for (auto& [texture, monitor] : monitors_of(manifest, waves[1])) {
    monitor.bars = bars[texture].bars;
    GW_RETURN_IF_ERROR(check_monitor(monitor, manifest.monitors(texture).name()));
    monitor.solids = solids[1][texture];
    layout.object.push_back(monitor);
  }
  for (auto& [texture, monitor] : monitors_of(manifest, waves[0])) {
    if (!check_monitor(monitor, manifest.monitors(texture).name()).ok()) continue;
    monitor.solids = solids[0][texture];
    layout.empty.push_back(monitor);
  }
  layout.stage = lay_out_stage(manifest, exposures);
  return layout;
}

std::vector<int> frames_of(const FringeLayout& layout) {
  const std::vector<int> stage = frames_of(layout.stage);
  std::set<int> frames(stage.begin(), stage.end());
  const auto need = [&](const Shot& shot) {
    for (const ExposedFrame& exposed : shot) frames.insert(exposed.frame);
  };
  for (const auto* const monitors : {&layout.object, &layout.empty}) {
    for (const WaveMonitor& monitor : *monitors) {
      for (const Solid& solid : monitor.solids) need(solid.shot);
      for (const Wave& wave : monitor.waves) std::ranges::for_each(wave.shots, need);
      for (const auto& along : monitor.bars) {
        for (const Bars& bars : along) {
          need(bars.lit);
          need(bars.complement);
        }
      }
    }
  }
  need(layout.empty_black);
  return {frames.begin(), frames.end()};
}

}  // namespace glasswing
