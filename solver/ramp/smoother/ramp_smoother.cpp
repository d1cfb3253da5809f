#include "solver/ramp/smoother/ramp_smoother.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <vector>

#include "core/base/for_rows.h"
#include "core/base/status.h"
#include "solver/method/method.h"
#include "solver/ramp/smoother/ramp_smoother_diffusion.h"
#include "solver/ramp/smoother/ramp_smoother_motion.h"
#include "solver/ramp/smoother/ramp_smoother_pilot.h"
#include "solver/ramp/smoother/ramp_smoother_refine.h"

namespace glasswing {
namespace {

// Radii of the last steps, after the pilot's. At half resolution the first ones are smaller.
constexpr int kRadius_px = 4, kHalfRadius_px = 3;

absl::StatusOr<int> whole_option(const std::string& key, const std::string& value, int low, int high) {
  GW_ASSIGN_OR_RETURN(const double number, number_option(key, value, low, high));
  if (number != std::floor(number))
    return absl::InvalidArgumentError(fmt::format("{} is \"{}\"; it must be a whole number", key, value));
  return static_cast<int>(number);
}

// The index of the value in `names`.
absl::StatusOr<int> named_option(const std::string& key, const std::string& value,
                                 std::initializer_list<std::string_view> names) {
  const auto found = std::ranges::find(names, value);
  if (found != names.end()) return static_cast<int>(found - names.begin());
  return absl::InvalidArgumentError(
      fmt::format("{} is \"{}\"; it must be one of: {}", key, value, fmt::join(names, ", ")));
}

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
    for (auto i = static_cast<size_t>(first); i < static_cast<size_t>(last); ++i)
      copy.*kPlanes[i] = frame.*kPlanes[i];
  });
  return copy;
}

}  // namespace

std::string_view smoothing_options_help() {
  return "smoothing            adaptive (default), perona-malik or none\n"
         "smoothing_reach      0 to 4, default 1: number of frames used before and after\n"
         "smoothing_iterations 1 to 1000, default 10: perona-malik only\n"
         "smoothing_contrast   0.001 to 10000, default 4: perona-malik only, monitor px; larger steps of c "
         "are "
         "edges\n"
         "smoothing_conductance exponential (default) or rational: perona-malik only";
}

absl::StatusOr<bool> parse_smoothing_option(const std::string& key, const std::string& value,
                                            SmoothingOptions& options) {
  if (key == "smoothing") {
    GW_ASSIGN_OR_RETURN(const int which, named_option(key, value, {"none", "perona-malik", "adaptive"}));
    options.smoothing = static_cast<Smoothing>(which);
  } else if (key == "smoothing_reach") {
    GW_ASSIGN_OR_RETURN(options.reach, whole_option(key, value, 0, 4));
  } else if (key == "smoothing_iterations") {
    GW_ASSIGN_OR_RETURN(options.iterations, whole_option(key, value, 1, 1000));
  } else if (key == "smoothing_contrast") {
    GW_ASSIGN_OR_RETURN(options.contrast_px, number_option(key, value, 0.001, 10000.0));
  } else if (key == "smoothing_conductance") {
    GW_ASSIGN_OR_RETURN(const int which, named_option(key, value, {"rational", "exponential"}));
    options.exponential = which == 1;
  } else {
    return false;
  }
  return true;
}

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
