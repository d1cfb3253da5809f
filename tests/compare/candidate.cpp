#include "tests/compare/candidate.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "solver/gaussian/fewer_images.h"

namespace glasswing {
namespace {

absl::StatusOr<SynthesizedCapture> everything(const RenderedScene& scene) {
  return as_recorded(scene.manifest());
}

bool is_black_or_white(const v1::Stimulus& stimulus) {
  return stimulus.kind() == "solid" && std::ranges::all_of(stimulus.colour(), [&](double light) {
           return light == stimulus.colour(0) && (light == 0.0 || light == 1.0);
         });
}

// Black, white and square waves down to a level, with complements.
absl::StatusOr<SynthesizedCapture> square_waves(const RenderedScene& scene, int levels) {
  return part_of(scene.manifest(), [&](const v1::Frame& frame) {
    const v1::Stimulus& stimulus = frame.stimulus();
    return is_black_or_white(stimulus) || (stimulus.kind() == "square" && stimulus.level() <= levels);
  });
}

absl::StatusOr<SynthesizedCapture> black_and_white(const RenderedScene& scene) {
  return square_waves(scene, 0);
}

// Sinusoids along one direction.
struct Waves {
  double phi_deg = 0.0;
  std::vector<double> period_px;
  bool without_object = false;  // also recorded without the object
};

// Black, white and all phases of each wave, on each monitor.
absl::StatusOr<SynthesizedCapture> fringes(const RenderedScene& scene, const std::vector<Waves>& directions,
                                           int phases) {
  const v1::CaptureManifest& recorded = scene.manifest();
  StripeSums sums(recorded);
  SynthesizedCapture capture =
      part_of(recorded, [](const v1::Frame& frame) { return is_black_or_white(frame.stimulus()); });
  for (const v1::Monitor& monitor : recorded.monitors()) {
    for (const Waves& waves : directions) {
      for (const double period_px : waves.period_px) {
        for (int phase = 0; phase < phases; ++phase) {
          v1::Frame frame;
          v1::Stimulus& wave = *frame.mutable_stimulus();
          wave.set_kind("sinusoid");
          wave.set_panel(monitor.name());
          wave.set_phi_deg(waves.phi_deg);
          wave.set_period_px(period_px);
          wave.set_phase_deg(360.0 * phase / phases);
          wave.set_peak(1.0);
          frame.set_object(true);
          GW_ASSIGN_OR_RETURN(std::vector<Part> parts, sums.parts(wave, waves.phi_deg));
          capture.add(frame, std::move(parts));
          // Without the object only the monitor behind the stage is visible.
          if (!waves.without_object || monitor.name() != recorded.monitors(0).name()) continue;
          frame.set_object(false);
          capture.add(frame, {});
        }
      }
    }
  }
  return capture;
}

}  // namespace

std::vector<Candidate> candidates() {
  std::vector<Candidate> all;
  all.push_back({"alpha", "two backings", "alpha", {}, black_and_white});
  for (const int levels : {2, 3, 4, 5, 6, 7}) {
    all.push_back({"hierarchical",
                   fmt::format("{} levels", levels),
                   "hierarchical",
                   {},
                   [=](const RenderedScene& scene) { return square_waves(scene, levels); }});
  }
  // The first period is longer than any monitor's side; two on the empty stage separate the object from it.
  // The last set is that of deploy/plans/fringe.txtpb.
  struct Fringes {
    std::string variant;
    int phases;
    std::vector<Waves> waves;
  };
  const std::vector<Fringes> sets = {
      {"2 periods", 4, {{0.0, {144.0, 24.0}, true}, {90.0, {144.0, 24.0}, true}}},
      {"4 periods",
       4,
       {{0.0, {144.0, 24.0}, true}, {90.0, {144.0, 24.0}, true}, {0.0, {48.0, 16.0}}, {90.0, {48.0, 16.0}}}},
      {"4 periods, oblique too",
       3,
       {{0.0, {144.0, 64.0, 28.0, 12.0}, true},
        {90.0, {144.0, 64.0, 28.0, 12.0}, true},
        {45.0, {32.0, 14.0}, true},
        {-45.0, {32.0, 14.0}, true}}}};
  for (const char* modes : {"1", "2"}) {
    for (const Fringes& set : sets) {
      all.push_back({modes[0] == '1' ? "fringe" : "fringe, two modes",
                     set.variant,
                     "fringe",
                     {{"modes", modes}},
                     [set](const RenderedScene& scene) { return fringes(scene, set.waves, set.phases); }});
    }
  }
  for (const int images : {50, 70, 100, 150, 200}) {
    all.push_back({"gaussian, few images",
                   fmt::format("{} images", images),
                   "gaussian",
                   {},
                   [=](const RenderedScene& scene) { return fewer_images(scene.manifest(), images); }});
    all.push_back({"gaussian, designed waves",
                   fmt::format("{} images", images),
                   "gaussian",
                   {},
                   [=](const RenderedScene& scene) {
                     return fewer_images(scene.manifest(), images, FewerImages::kWaves);
                   }});
  }
  all.push_back({"gaussian, unoriented", "all sweeps", "gaussian", {{"oriented", "0"}}, everything});
  all.push_back({"gaussian", "all sweeps", "gaussian", {}, everything});
  return all;
}

}  // namespace glasswing
