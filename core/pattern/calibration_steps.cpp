#include "core/pattern/calibration_steps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kWhiteEvery = 8;

v1::Stimulus codes_on(const v1::Monitor& monitor, StimulusKind kind, const std::array<double, 3>& share) {
  v1::Stimulus stimulus;
  stimulus.set_kind(std::string(name_of(kind)));
  stimulus.set_panel(monitor.name());
  stimulus.set_codes(true);
  for (const double own : share) stimulus.add_colour(own);
  return stimulus;
}

void add_white(const v1::Monitor& monitor, std::vector<v1::Stimulus>& out) {
  for (const double share : {0.0, 1.0})
    out.push_back(codes_on(monitor, StimulusKind::kSolid, {share, share, share}));
}

void add_camera(const v1::Monitor& monitor, std::vector<v1::Stimulus>& out) {
  v1::Stimulus stripe = codes_on(monitor, StimulusKind::kStripe, {1.0, 1.0, 1.0});
  stripe.set_r_px(0.5 * monitor.width_px());
  stripe.set_sigma_px(monitor.width_px() / 8.0);
  stripe.set_peak(1.0);
  out.push_back(std::move(stripe));
  add_white(monitor, out);
}

void add_display(int grays, const v1::Monitor& monitor, std::vector<v1::Stimulus>& out) {
  const double highest = std::exp2(monitor.bits() > 0 ? monitor.bits() : 8) - 1.0;
  std::vector<v1::Stimulus> solids;
  for (int i = 1; i < grays; ++i) {
    const double share = std::round(i * highest / (grays - 1)) / highest;
    for (size_t primary = 0; primary < 3; ++primary) {
      std::array<double, 3> colour{};
      colour[primary] = share;
      solids.push_back(codes_on(monitor, StimulusKind::kSolid, colour));
    }
  }
  // Fisher-Yates by hand, since the result of std::shuffle depends on the library.
  std::mt19937 random(1);
  for (size_t i = solids.size(); i > 1; --i) std::swap(solids[i - 1], solids[random() % i]);
  for (size_t i = 0; i < solids.size(); ++i) {
    if (i % kWhiteEvery == 0) add_white(monitor, out);
    out.push_back(std::move(solids[i]));
  }
  add_white(monitor, out);
}

}  // namespace

int takes_of(const v1::CalibrationFrames& frames) {
  return frames.has_takes() ? frames.takes() : frames.of() == "camera" ? 4 : 2;
}

int grays_of(const v1::CalibrationFrames& frames) {
  return frames.has_grays() ? frames.grays() : kDefaultGrays;
}

std::vector<v1::Stimulus> calibration_stimuli(const v1::CalibrationFrames& frames,
                                              const v1::Monitor& monitor) {
  std::vector<v1::Stimulus> out;
  const bool camera = frames.of() == "camera";
  for (int take = 0; take < takes_of(frames); ++take) {
    if (camera) {
      add_camera(monitor, out);
    } else {
      add_display(grays_of(frames), monitor, out);
    }
  }
  if (!camera) out.push_back(codes_on(monitor, StimulusKind::kRamp, {1.0, 1.0, 1.0}));
  return out;
}

}  // namespace glasswing
