#include "solver/gaussian/fewer_images.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>

#include "core/base/status.h"
#include "core/design/plan_design.h"
#include "core/design/wave_ladder.h"
#include "core/pattern/stimulus_kind.h"
#include "solver/background/stage_layout.h"
#include "solver/method/exposure_merge.h"
#include "solver/method/sample_noise.h"
#include "solver/mixture/mixture_layout.h"

namespace glasswing {
namespace {

constexpr double kUsualNoise = 0.005;  // of a camera that is not calibrated
constexpr double kFinest = 2.0;        // the shortest period considered, in sigmas of the recorded stripes
// Bars along the monitor's longer side that determine the silhouette: broad ones detect light from afar,
// narrow ones a view shifted by a fraction of a pixel. The narrow ones have complements, which determine the
// noise.
constexpr double kBroadBars = 8.0, kNarrowBars = 32.0;

// One monitor's recorded sweeps.
struct Swept {
  v1::Monitor monitor;
  std::map<double, double> sigma_px;  // narrowest by direction
};

std::vector<Swept> swept_monitors(const v1::CaptureManifest& recorded) {
  std::vector<Swept> all;
  for (const v1::Monitor& monitor : recorded.monitors()) {
    Swept swept{.monitor = monitor, .sigma_px = {}};
    for (const v1::Frame& frame : recorded.frames()) {
      const v1::Stimulus& stimulus = frame.stimulus();
      if (!is_pattern(frame) || !frame.object() || kind_of(stimulus) != StimulusKind::kStripe ||
          stimulus.panel() != monitor.name())
        continue;
      const auto [known, added] = swept.sigma_px.emplace(stimulus.phi_deg(), stimulus.sigma_px());
      if (!added) known->second = std::min(known->second, stimulus.sigma_px());
    }
    if (!swept.sigma_px.empty()) all.push_back(std::move(swept));
  }
  return all;
}

// The directions nearest to 0, 90, 45 and -45 degrees, in that order, each once.
std::vector<double> usual_directions(const std::map<double, double>& recorded) {
  std::vector<double> chosen;
  for (const double usual : {0.0, 90.0, 45.0, -45.0}) {
    std::optional<double> nearest;
    const auto miss = [&](double phi_deg) { return std::abs(std::remainder(phi_deg - usual, 180.0)); };
    for (const auto& [phi_deg, sigma_px] : recorded) {
      if (std::ranges::find(chosen, phi_deg) != chosen.end()) continue;
      if (!nearest || miss(phi_deg) < miss(*nearest)) nearest = phi_deg;
    }
    if (nearest) chosen.push_back(*nearest);
  }
  return chosen;
}

// The recorded widths nearest to the wanted ones, on one monitor.
struct Bars {
  double broad_px = 0.0, narrow_px = 0.0;
};

std::map<std::string, Bars> bars_of(const v1::CaptureManifest& recorded) {
  std::map<std::string, Bars> bars;
  for (const v1::Monitor& monitor : recorded.monitors()) {
    const int side_px = std::max(monitor.width_px(), monitor.height_px());
    const auto nearest = [&](double wanted_px) {
      double best = 0.0;
      const auto miss = [&](double px) { return std::abs(std::log(px / wanted_px)); };
      for (const v1::Frame& frame : recorded.frames()) {
        const v1::Stimulus& stimulus = frame.stimulus();
        if (!is_pattern(frame) || kind_of(stimulus) != StimulusKind::kSquare ||
            stimulus.panel() != monitor.name())
          continue;
        if (best == 0.0 || miss(stimulus.bar_width_px()) < miss(best)) best = stimulus.bar_width_px();
      }
      return best;
    };
    bars[monitor.name()] = {.broad_px = nearest(side_px / kBroadBars),
                            .narrow_px = nearest(side_px / kNarrowBars)};
  }
  return bars;
}

bool tells_the_stage(const v1::Frame& frame, const std::map<std::string, Bars>& bars) {
  const v1::Stimulus& stimulus = frame.stimulus();
  if (kind_of(stimulus) == StimulusKind::kSolid) return gray_of(stimulus) == 0.0 || gray_of(stimulus) == 1.0;
  const auto own = bars.find(stimulus.panel());
  if (kind_of(stimulus) != StimulusKind::kSquare || own == bars.end()) return false;
  return stimulus.bar_width_px() == own->second.narrow_px ||
         (stimulus.bar_width_px() == own->second.broad_px && !stimulus.inverse());
}

v1::Stimulus wave_on(const v1::Monitor& monitor, const DesignedWave& designed, double phase_deg) {
  v1::Stimulus wave;
  wave.set_kind("sinusoid");
  wave.set_panel(monitor.name());
  wave.set_phi_deg(designed.phi_deg);
  wave.set_period_px(designed.period_px);
  wave.set_phase_deg(phase_deg);
  wave.set_peak(1.0);
  return wave;
}

absl::Status add_waves(const Swept& swept, int images, const CameraNoise& noise, bool shown, StripeSums& sums,
                       double exposure_ms, SynthesizedCapture& capture) {
  const std::vector<double> phi_deg = usual_directions(swept.sigma_px);
  const MonitorExtent extent{.width_px = static_cast<double>(swept.monitor.width_px()),
                             .height_px = static_cast<double>(swept.monitor.height_px())};
  if (images < kMinPatterns || phi_deg.size() < 3) {
    return absl::FailedPreconditionError(fmt::format(
        "so few images leave {} for monitor \"{}\", which was swept in {} directions; they must leave "
        "at least {}, in 3",
        std::max(images, 0), swept.monitor.name(), phi_deg.size(), kMinPatterns));
  }
  double recorded_px = 0.0;
  for (const auto& [phi, sigma_px] : swept.sigma_px) recorded_px = std::max(recorded_px, sigma_px);
  const auto noise_scale = [&](const DesignedWave& wave) {
    const absl::StatusOr<std::vector<Part>> parts =
        sums.parts(wave_on(swept.monitor, wave, 0.0), wave.phi_deg);
    return !parts.ok() ? INFINITY : shown ? 1.0 : std::max(noise_of(*parts), 1.0);
  };
  const double shortest_px = best_shortest_px(extent, phi_deg, images / 2, kFinest * recorded_px, noise,
                                              usual_prior(extent, FootprintPrior{}.modes), noise_scale);
  for (const DesignedWave& designed : wave_ladder(extent, phi_deg, images / 2, shortest_px)) {
    for (const double phase_deg : {0.0, 90.0}) {
      v1::Frame frame;
      frame.set_file(
          fmt::format("wave {:g} deg {:g} px, {:g} deg", designed.phi_deg, designed.period_px, phase_deg));
      frame.set_object(true);
      frame.set_exposure_ms(exposure_ms);
      *frame.mutable_stimulus() = wave_on(swept.monitor, designed, phase_deg);
      GW_ASSIGN_OR_RETURN(std::vector<Part> parts, sums.parts(frame.stimulus(), designed.phi_deg));
      capture.add(frame, std::move(parts));
    }
  }
  return absl::OkStatus();
}

}  // namespace

double noise_of(const std::vector<Part>& parts) {
  double squares = 0.0;
  for (const Part& part : parts) squares += part.weight * part.weight;
  return std::sqrt(squares);
}

absl::StatusOr<SynthesizedCapture> fewer_images(const v1::CaptureManifest& recorded, int images, bool shown) {
  GW_ASSIGN_OR_RETURN(const Exposures exposures, Exposures::of(recorded));
  const auto usable = [&](const v1::Frame& frame) {
    return is_pattern(frame) && frame.exposure_ms() == exposures.times_ms().front();
  };
  const std::vector<Swept> monitors = swept_monitors(recorded);
  if (std::ranges::count_if(recorded.frames(), usable) <= images || monitors.empty())
    return part_of(recorded, [&](const v1::Frame& f) {
      return usable(f) || kind_of(f.stimulus()) == StimulusKind::kPatch;
    });
  const std::map<std::string, Bars> bars = bars_of(recorded);
  SynthesizedCapture capture = part_of(recorded, [&](const v1::Frame& frame) {
    return kind_of(frame.stimulus()) == StimulusKind::kPatch ||
           (usable(frame) && tells_the_stage(frame, bars));
  });
  const auto stage = std::ranges::count_if(capture.manifest.frames(), usable);
  const int each = (images - static_cast<int>(stage)) / static_cast<int>(monitors.size());
  const SampleNoise own = sample_noise(recorded.camera(), kUsualNoise);
  CameraNoise noise{.read_sd = own.read_sd, .full_well = {}};
  if (own.gain > 0.0) noise.full_well = 1.0 / own.gain;
  StripeSums sums(recorded);
  for (const Swept& swept : monitors) {
    GW_RETURN_IF_ERROR(add_waves(swept, each, noise, shown, sums, exposures.times_ms().front(), capture));
  }
  return capture;
}

}  // namespace glasswing
