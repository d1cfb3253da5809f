#include "solver/method/exposure_merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/pattern/stimulus_kind.h"

namespace glasswing {

bool is_black(const v1::Frame& frame) {
  const v1::Stimulus& stimulus = frame.stimulus();
  return kind_of(stimulus) == StimulusKind::kSolid && stimulus.colour_size() == 3 &&
         std::ranges::all_of(stimulus.colour(), [](double value) { return value == 0.0; }) &&
         frame.also_lit().empty();
}

bool is_pattern(const v1::Frame& frame) {
  const StimulusKind kind = kind_of(frame.stimulus());
  return !frame.stimulus().reference() && frame.also_lit_size() == 0 &&
         (kind == StimulusKind::kSolid || kind == StimulusKind::kSquare || kind == StimulusKind::kStripe ||
          kind == StimulusKind::kSinusoid);
}

absl::StatusOr<Exposures> Exposures::of(const v1::CaptureManifest& manifest) {
  Exposures exposures;
  for (const v1::Frame& frame : manifest.frames()) {
    if (!is_pattern(frame)) continue;
    const double time_ms = frame.exposure_ms();
    if (!(time_ms >= 0.0) || !std::isfinite(time_ms)) {
      return absl::FailedPreconditionError(
          fmt::format("{} has an exposure of {} ms; it must be a number from 0", frame.file(), time_ms));
    }
    if (std::ranges::find(exposures.times_ms_, time_ms) == exposures.times_ms_.end())
      exposures.times_ms_.push_back(time_ms);
    const double reference_ms = exposures.times_ms_.front();
    if (time_ms != reference_ms && !(time_ms > 0.0 && reference_ms > 0.0)) {
      return absl::FailedPreconditionError(fmt::format(
          "{} has an exposure of {} ms and others {} ms; where they differ every one must be known",
          frame.file(), time_ms, reference_ms));
    }
  }
  return exposures;
}

ExposedFrame Exposures::exposed(const v1::CaptureManifest& manifest, int frame) const {
  const double time_ms = manifest.frames(frame).exposure_ms(), reference_ms = times_ms_.front();
  return {.frame = frame, .scale = time_ms == reference_ms ? 1.0 : reference_ms / time_ms};
}

MergedSample merge(const FrameStack& stack, std::span<const ExposedFrame> shot, size_t index,
                   const SampleNoise& noise) {
  const auto sample = [&](const ExposedFrame& exposed) { return stack.rows[exposed.frame][index]; };
  const ExposedFrame *longest = nullptr, *shortest = &shot.front();
  for (const ExposedFrame& exposed : shot) {
    if (exposed.scale > shortest->scale) shortest = &exposed;
    if (sample(exposed) >= kSaturatedCode) continue;
    if (longest == nullptr || exposed.scale < longest->scale) longest = &exposed;
  }
  const auto radiance = [&](const ExposedFrame& exposed) {
    return stack.light(sample(exposed)) * exposed.scale;
  };
  const double expected = radiance(longest != nullptr ? *longest : *shortest);
  const auto variance = [&](const ExposedFrame& exposed) {
    return std::max(exposed.scale * exposed.scale * noise.variance(expected / exposed.scale), 1e-20);
  };
  if (longest == nullptr) return {.radiance = expected, .variance = variance(*shortest), .saturated = true};
  if (shot.size() == 1) return {.radiance = expected, .variance = variance(*longest)};
  double sum = 0.0, weight = 0.0;
  for (const ExposedFrame& exposed : shot) {
    if (sample(exposed) >= kSaturatedCode) continue;
    const double own = 1.0 / variance(exposed);
    sum += own * radiance(exposed);
    weight += own;
  }
  return {.radiance = sum / weight, .variance = 1.0 / weight};
}

}  // namespace glasswing
