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

constexpr double kStep = 1.1;    // of a stripe's sigma
constexpr double kMargin = 1.5;  // sigmas past the monitor's edge
constexpr double kFinestSpacing = 0.5;
constexpr int kMinSteps = 5;           // of a sweep
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

// The sweeps to synthesize instead.
struct Choice {
  std::vector<double> phi_deg;
  double sigma_px = 0.0, step_px = 0.0;
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

// Stripe positions k step_px, out to the margin.
struct Travel {
  double first = 0.0, last = 0.0;  // k
  int count() const { return static_cast<int>(last - first) + 1; }
};

Travel travel_of(const v1::Monitor& monitor, double phi_deg, double sigma_px, double step_px) {
  const double phi_rad = phi_deg * std::numbers::pi / 180.0;
  const double across = monitor.width_px() * std::cos(phi_rad),
               down = monitor.height_px() * std::sin(phi_rad);
  const double low = std::min(across, 0.0) + std::min(down, 0.0) - kMargin * sigma_px;
  const double high = std::max(across, 0.0) + std::max(down, 0.0) + kMargin * sigma_px;
  constexpr double kSlack = 1e-9;
  return {.first = std::ceil(low / step_px - kSlack), .last = std::floor(high / step_px + kSlack)};
}

int count_of(const Swept& swept, const Choice& choice) {
  int count = 0;
  for (const double phi_deg : choice.phi_deg)
    count += travel_of(swept.monitor, phi_deg, choice.sigma_px, choice.step_px).count();
  return count;
}

// The choice with the smallest sigma of at least `min_px` for a step of `step` sigmas.
Choice narrowest(const Swept& swept, std::vector<double> phi_deg, double step, double min_px, int images) {
  const auto with = [&](double sigma_px) {
    return Choice{.phi_deg = phi_deg, .sigma_px = sigma_px, .step_px = step * sigma_px};
  };
  double low = min_px, high = min_px;
  if (count_of(swept, with(low)) <= images) return with(low);
  while (count_of(swept, with(high)) > images) high *= 2.0;
  while (high - low > 1e-3 * low) {
    const double middle = 0.5 * (low + high);
    (count_of(swept, with(middle)) > images ? low : high) = middle;
  }
  return with(high);
}

absl::StatusOr<Choice> choose(const Swept& swept, int images) {
  const std::vector<double> all = usual_directions(swept.sigma_px);
  double min_px = 0.0;
  for (const double phi_deg : all) min_px = std::max(min_px, swept.sigma_px.at(phi_deg));
  const std::vector<double> three(all.begin(), all.begin() + std::min<std::ptrdiff_t>(3, std::ssize(all)));
  const auto too_few = [&] {
    return absl::FailedPreconditionError(fmt::format(
        "so few images leave {} for the sweeps of monitor \"{}\"; they must leave at least {} for each of 3 "
        "directions",
        std::max(images, 0), swept.monitor.name(), kMinSteps));
  };
  if (images < 3 * kMinSteps) return too_few();
  Choice choice = narrowest(swept, three, kStep, min_px, images);
  for (const double phi_deg : choice.phi_deg) {
    if (travel_of(swept.monitor, phi_deg, choice.sigma_px, choice.step_px).count() < kMinSteps)
      return too_few();
  }
  const Choice with_all{.phi_deg = all, .sigma_px = min_px, .step_px = kStep * min_px};
  if (choice.sigma_px > min_px || count_of(swept, with_all) > images) return choice;
  choice = with_all;
  for (double step = kStep; step > kFinestSpacing; step -= 0.01) {
    Choice finer = choice;
    finer.step_px = step * min_px;
    if (count_of(swept, finer) > images) break;
    choice = finer;
  }
  return choice;
}

// The recorded widths nearest to the requested ones, on one monitor.
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

absl::Status add_sweeps(const Swept& swept, const Choice& choice, StripeSums& sums, double exposure_ms,
                        SynthesizedCapture& capture) {
  for (const double phi_deg : choice.phi_deg) {
    const Travel travel = travel_of(swept.monitor, phi_deg, choice.sigma_px, choice.step_px);
    for (double k = travel.first; k <= travel.last; k += 1.0) {
      v1::Frame frame;
      frame.set_file(fmt::format("stripe {:g} deg {:g} px", phi_deg, k * choice.step_px));
      frame.set_object(true);
      frame.set_exposure_ms(exposure_ms);
      v1::Stimulus& stripe = *frame.mutable_stimulus();
      stripe.set_kind("gauss_stripe");
      stripe.set_panel(swept.monitor.name());
      stripe.set_phi_deg(phi_deg);
      stripe.set_r_px(k * choice.step_px);
      stripe.set_sigma_px(choice.sigma_px);
      stripe.set_peak(1.0);
      GW_ASSIGN_OR_RETURN(std::vector<Part> parts, sums.parts(frame.stimulus(), phi_deg));
      capture.add(frame, std::move(parts));
    }
  }
  return absl::OkStatus();
}

// The best waves for this many images; none if these are too few.
std::vector<DesignedWave> choose_waves(const Swept& swept, int images, const CameraNoise& noise,
                                       StripeSums& sums) {
  const std::vector<double> phi_deg = usual_directions(swept.sigma_px);
  if (images < kMinPatterns || phi_deg.size() < 3) return {};
  const MonitorExtent extent = extent_of(swept.monitor);
  const FootprintPrior prior = usual_prior(extent, FootprintPrior{}.modes);
  double recorded_px = 0.0;
  for (const auto& [phi, sigma_px] : swept.sigma_px) recorded_px = std::max(recorded_px, sigma_px);
  const auto can_be_summed = [&](const DesignedWave& wave) {
    return sums.parts(wave_on(swept.monitor, wave, 0.0), wave.phi_deg).ok() ? 1.0 : INFINITY;
  };
  const double shortest_px =
      best_shortest_px(extent, phi_deg, images / 2, kFinest * recorded_px, noise, prior, can_be_summed);
  return wave_ladder(extent, phi_deg, images / 2, shortest_px);
}

absl::Status add_waves(const Swept& swept, const std::vector<DesignedWave>& waves, StripeSums& sums,
                       double exposure_ms, SynthesizedCapture& capture) {
  for (const DesignedWave& designed : waves) {
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

absl::StatusOr<SynthesizedCapture> fewer_images(const v1::CaptureManifest& recorded, int images,
                                                FewerImages kind) {
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
    const double exposure_ms = exposures.times_ms().front();
    const std::vector<DesignedWave> waves =
        kind == FewerImages::kWaves ? choose_waves(swept, each, noise, sums) : std::vector<DesignedWave>();
    if (!waves.empty()) {
      GW_RETURN_IF_ERROR(add_waves(swept, waves, sums, exposure_ms, capture));
      continue;
    }
    GW_ASSIGN_OR_RETURN(const Choice choice, choose(swept, each));
    GW_RETURN_IF_ERROR(add_sweeps(swept, choice, sums, exposure_ms, capture));
  }
  return capture;
}

}  // namespace glasswing
