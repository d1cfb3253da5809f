#include "solver/ramp/smoother/ramp_smoother.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <vector>

#include "core/base/for_rows.h"
#include "solver/ramp/smoother/ramp_smoother_diffusion.h"
#include "solver/ramp/smoother/ramp_smoother_motion.h"
#include "solver/ramp/smoother/ramp_smoother_pilot.h"
#include "solver/ramp/smoother/ramp_smoother_refine.h"

namespace glasswing {
namespace {

// Radii of the last steps, after the pilot's. At half resolution the first ones are smaller.
constexpr int kRadius_px = 4, kHalfRadius_px = 3;

RampFrame copy_of(const RampFrame& frame, int thread_count) {
  constexpr std::array kPlanes{&RampFrame::alpha,     &RampFrame::rho,     &RampFrame::x_px,
                               &RampFrame::y_px,      &RampFrame::info_xx, &RampFrame::info_xy,
                               &RampFrame::highlight, &RampFrame::info_yy};
  RampFrame copy;
  copy.width_px = frame.width_px;
  copy.height_px = frame.height_px;
  copy.rho_sd = frame.rho_sd;
  copy.flags = frame.flags;
  for_rows(static_cast<int>(kPlanes.size()), thread_count, [&](int first, int last) {
    for (size_t i = first; i < static_cast<size_t>(last); ++i) copy.*kPlanes[i] = frame.*kPlanes[i];
  });
  return copy;
}

}  // namespace

void RampSmoother::prepare(SmoothInput& input, int thread_count) const {
  if (options_.smoothing == Smoothing::kAdaptive && input.pilot == nullptr)
    input.pilot = std::make_shared<const SmoothPilot>(make_pilot(*input.frame, thread_count));
}

RampFrame RampSmoother::smooth(std::span<const SmoothInput> window, size_t at, int thread_count) const {
  assert(at < window.size());
  if (options_.smoothing == Smoothing::kNone) return *window[at].frame;
  const size_t first = at - std::min(at, static_cast<size_t>(frames_before()));
  const size_t last = std::min(window.size(), at + static_cast<size_t>(frames_after()) + 1);
  const std::span<const SmoothInput> near = window.subspan(first, last - first);
  if (options_.smoothing == Smoothing::kAdaptive) return adapt(near, at - first, thread_count);
  std::vector<const RampFrame*> frames;
  for (const SmoothInput& input : near) frames.push_back(input.frame);
  RampFrame result = *window[at].frame;
  diffuse(frames, at - first,
          {.iterations = options_.iterations,
           .contrast_px = static_cast<float>(options_.contrast_px),
           .exponential = options_.exponential},
          thread_count, result);
  return result;
}

RampFrame RampSmoother::adapt(std::span<const SmoothInput> window, size_t at, int thread_count) const {
  std::vector<SmoothInput> inputs(window.begin(), window.end());
  for (SmoothInput& input : inputs) prepare(input, thread_count);
  std::vector<const SmoothPilot*> others;
  for (size_t i = 0; i < inputs.size(); ++i) {
    if (i != at) others.push_back(inputs[i].pilot.get());
  }
  const SmoothPilot& pilot = *inputs[at].pilot;
  const SmoothSamples joined = join_along_motion(pilot, others, thread_count);
  // Twice: gradients from the first pass separate the pieces better.
  SmoothState wider, state;
  const int radius_px = pilot.fine.has_value() ? kHalfRadius_px : kRadius_px;
  widen(pilot.area, joined, pilot.rho_info, radius_px, thread_count, &pilot.state, wider);
  widen(pilot.area, joined, pilot.rho_info, kRadius_px, thread_count, &wider, state);
  RampFrame result = copy_of(*inputs[at].frame, thread_count);
  if (pilot.fine.has_value()) {
    refine(pilot, state, thread_count, result);
  } else {
    for_rows(pilot.area.height, thread_count, [&](int first, int last) {
      put_rows(pilot.straight, pilot.area, pilot.samples, pilot.rho_info, state, first, last, result);
    });
  }
  return result;
}

}  // namespace glasswing
