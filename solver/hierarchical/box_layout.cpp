#include "solver/hierarchical/box_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "core/base/status.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kMinWaves = 4;

using Light = std::array<double, 3>;
using Key = std::tuple<double, double, Light>;  // minus the width of the bars; offset; light

struct Wave {
  Shot lit, complement;
};
struct Shown {
  std::array<std::map<Key, Wave>, 2> waves;
  std::map<Light, Shot> solids;
};

Light light_of(const v1::Stimulus& stimulus) {
  return {colour_of(stimulus, 0), colour_of(stimulus, 1), colour_of(stimulus, 2)};
}

bool is_light(const Light& light) {
  const auto in_range = [](double value) { return value >= 0.0 && value <= 1.0; };
  return std::ranges::all_of(light, in_range);
}

bool is_dark(const Light& light) {
  return std::ranges::all_of(light, [](double value) { return value == 0.0; });
}

absl::Status add_wave(const v1::Frame& frame, const ExposedFrame& exposed, Shown& shown) {
  const v1::Stimulus& stimulus = frame.stimulus();
  const bool vertical = stimulus.orient() == "vertical_bars";
  if (!vertical && stimulus.orient() != "horizontal_bars") {
    return absl::FailedPreconditionError(
        fmt::format("{} shows bars of orient \"{}\"; available: vertical_bars, horizontal_bars", frame.file(),
                    stimulus.orient()));
  }
  const double bar_px = stimulus.bar_width_px();
  if (!(bar_px >= 1.0 && bar_px <= 1e5) || !std::isfinite(stimulus.offset_px())) {
    return absl::FailedPreconditionError(
        fmt::format("{} shows bars of {} px from {} px on; accepted are 1 to 100000 px wide, at a finite "
                    "position",
                    frame.file(), bar_px, stimulus.offset_px()));
  }
  const double offset_px =
      std::fmod(std::fmod(stimulus.offset_px(), 2.0 * bar_px) + 2.0 * bar_px, 2.0 * bar_px);
  Wave& wave = shown.waves[vertical ? 0 : 1][{-bar_px, offset_px, light_of(stimulus)}];
  (stimulus.inverse() ? wave.complement : wave.lit).push_back(exposed);
  return absl::OkStatus();
}

absl::StatusOr<BoxMonitor> monitor_of(const Shown& shown, const v1::Monitor& monitor, int texture,
                                      bool has_black) {
  BoxMonitor result;
  result.texture = texture;
  result.width_px = monitor.width_px();
  result.height_px = monitor.height_px();
  for (const auto& [light, shot] : shown.solids)
    result.patterns.push_back(
        {.axis = BoxPattern::kSolid, .wave = 0, .sign = 1.0, .light = light, .shot = shot});
  bool complements = false;
  for (size_t axis = 0; axis < 2; ++axis) {
    const size_t count = shown.waves[axis].size();
    if (count == 0 || count > WaveAxis::kMaxWaves) {
      return absl::FailedPreconditionError(fmt::format(
          "monitor \"{}\" showed {} square waves of {} bars with the object; a box needs 1 to {} of either",
          monitor.name(), count, axis == 0 ? "vertical" : "horizontal", WaveAxis::kMaxWaves));
    }
    for (const auto& [key, wave] : shown.waves[axis]) {
      const auto& [minus_bar_px, offset_px, light] = key;
      const size_t place = result.waves[axis].size();
      result.waves[axis].push_back({.bar_px = -minus_bar_px, .offset_px = offset_px});
      complements = complements || (!wave.lit.empty() && !wave.complement.empty());
      for (const double sign : {1.0, -1.0}) {
        const Shot& shot = sign > 0.0 ? wave.lit : wave.complement;
        if (shot.empty()) continue;
        result.patterns.push_back(
            {.axis = static_cast<int>(axis), .wave = place, .sign = sign, .light = light, .shot = shot});
      }
    }
  }
  // Several waves are their own black and white, if a pixel sees lit and dark bars.
  const size_t fewest = std::min(result.waves[0].size(), result.waves[1].size());
  if (!complements && fewest < kMinWaves && (!has_black || shown.solids.empty())) {
    return absl::FailedPreconditionError(fmt::format(
        "monitor \"{}\" showed {} square waves along an axis without complements; then black and a solid are "
        "needed, with the object, or {} waves along either axis",
        monitor.name(), fewest, kMinWaves));
  }
  return result;
}

void warn(const BoxMonitor& monitor, const std::string& name, std::vector<std::string>& warnings) {
  for (size_t axis = 0; axis < 2; ++axis) {
    const int extent_px = axis == 0 ? monitor.width_px : monitor.height_px;
    const auto alike_px = WaveAxis(monitor.waves[axis], extent_px).alike_px();
    if (!alike_px) continue;
    warnings.push_back(fmt::format(
        "the {} bars of monitor \"{}\" are alike at {:g} px and at {:g} px: small boxes may lie at "
        "either",
        axis == 0 ? "vertical" : "horizontal", name, (*alike_px)[0], (*alike_px)[1]));
  }
}

bool shows_bars(const EmptyMonitor& monitor) {
  return !monitor.bars[0].empty() && !monitor.bars[1].empty();
}

}  // namespace

absl::StatusOr<BoxLayout> lay_out_boxes(const v1::CaptureManifest& manifest) {
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(manifest));
  BoxLayout layout;
  layout.stage = lay_out_stage(manifest, exposures);
  std::map<int, Shown> shown;  // by texture
  for (int i = 0; i < manifest.frames_size(); ++i) {
    const v1::Frame& frame = manifest.frames(i);
    const v1::Stimulus& stimulus = frame.stimulus();
    const bool wave = kind_of(stimulus) == StimulusKind::kSquare;
    if (!is_pattern(frame) || !frame.object() || (!wave && kind_of(stimulus) != StimulusKind::kSolid))
      continue;
    const Light light = light_of(stimulus);
    if (!wave && is_dark(light)) continue;
    const auto monitor =
        std::ranges::find(manifest.monitors(), stimulus.panel(), [](const auto& m) { return m.name(); });
    if (monitor == manifest.monitors().end()) {
      return absl::FailedPreconditionError(fmt::format(
          "{} names monitor \"{}\", which the manifest does not list", frame.file(), stimulus.panel()));
    }
    if (!is_light(light) || is_dark(light)) {
      return absl::FailedPreconditionError(
          fmt::format("{} shows light of {} {} {}; accepted is 0 to 1, and not all 0", frame.file(), light[0],
                      light[1], light[2]));
    }
    Shown& own = shown[static_cast<int>(monitor - manifest.monitors().begin())];
    const ExposedFrame exposed = exposures.exposed(manifest, i);
    if (wave) {
      GW_RETURN_IF_ERROR(add_wave(frame, exposed, own));
    } else {
      own.solids[light].push_back(exposed);
    }
  }
  for (const auto& [texture, own] : shown) {
    if (own.waves[0].empty() && own.waves[1].empty()) continue;
    GW_ASSIGN_OR_RETURN(BoxMonitor monitor,
                        monitor_of(own, manifest.monitors(texture), texture, !layout.stage.black.empty()));
    warn(monitor, manifest.monitors(texture).name(), layout.warnings);
    layout.monitors.push_back(std::move(monitor));
  }
  const bool stage_alone = layout.stage.bare && std::ranges::any_of(layout.stage.monitors, &shows_bars);
  if (layout.monitors.empty() && !stage_alone) {
    return absl::FailedPreconditionError("the archive has no square waves (kind square, with the object)");
  }
  if (layout.monitors.size() > kMaxModes) {
    return absl::FailedPreconditionError(fmt::format(
        "{} monitors showed square waves; at most {} can be solved", layout.monitors.size(), kMaxModes));
  }
  return layout;
}

std::vector<int> frames_of(const BoxLayout& layout) {
  const std::vector<int> stage = frames_of(layout.stage);
  std::set<int> frames(stage.begin(), stage.end());
  for (const BoxMonitor& monitor : layout.monitors) {
    for (const BoxPattern& pattern : monitor.patterns) {
      for (const ExposedFrame& exposed : pattern.shot) frames.insert(exposed.frame);
    }
  }
  return {frames.begin(), frames.end()};
}

}  // namespace glasswing
