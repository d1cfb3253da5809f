#include "solver/corrections/steady_light.h"

#include <fmt/format.h>

#include <map>
#include <utility>

#include "core/pattern/stimulus_kind.h"
#include "solver/corrections/light_changes.h"
#include "solver/corrections/quarters.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr int kMaxRounds = 3;

// light' = (light - ghosts) / left, light'' = (light' - share mean') / (1 - share).
FrameCorrections without(const FrameReport& report, const Removed& removed) {
  FrameCorrections corrections = no_corrections(report);
  const auto left = static_cast<float>(removed.ghosts ? 1.0 - report.ghost_share() : 1.0);
  const auto share = static_cast<float>(removed.flare ? report.flare.value : 0.0);
  for (size_t k = 0; k < kGhosts && removed.ghosts; ++k)
    corrections.ghost[k] = static_cast<float>(report.ghost[k].value);
  for (size_t f = 0; f < report.frames.size(); ++f) {
    FrameCorrection& own = corrections.of_frame[f];
    for (size_t c = 0; c < kChannels; ++c) {
      own.offset[c] = left * share * static_cast<float>(report.frames[f].mean[c]);
      own.gain[c] = left * (1.0f - share);
    }
  }
  return corrections;
}

// The brightest gray picture of the same monitor and exposure that is darker than this and not clipped.
GrayFrames grays_for(const v1::CaptureManifest& manifest, const FrameReport& report, int f,
                     const std::vector<int>& frames) {
  const v1::Frame& frame = manifest.frames(f);
  GrayFrames grays;
  for (const int other : frames) {
    const v1::Frame& solid = manifest.frames(other);
    if (kind_of(solid.stimulus()) != StimulusKind::kSolid || !is_pattern(solid) ||
        solid.object() != frame.object() || solid.exposure_ms() != frame.exposure_ms() ||
        solid.stimulus().panel() != frame.stimulus().panel())
      continue;
    const double level = gray_of(solid.stimulus()) / gray_of(frame.stimulus());
    if (level == 0.0) grays.black = other;
    if (!(level > 0.0 && level < 1.0) || report.frames[other].clipped) continue;
    if (grays.gray >= 0 && level < grays.level) continue;
    grays.gray = other;
    grays.level = static_cast<float>(level);
  }
  return grays;
}

// Where white is over-exposed: whether gray pictures show what pictures of solids and bars should be.
bool take_grays(const v1::CaptureManifest& manifest, const FrameReport& report,
                const std::vector<int>& frames, FrameCorrections& corrections) {
  std::map<int, GrayFrames> grays;
  bool over_exposed = false;
  for (const int f : frames) {
    const StimulusKind kind = kind_of(manifest.frames(f).stimulus());
    if (kind != StimulusKind::kSolid && kind != StimulusKind::kSquare) continue;
    const GrayFrames own = grays_for(manifest, report, f, frames);
    if (own.gray < 0 || own.black < 0) continue;
    grays[f] = own;
    over_exposed = over_exposed || report.frames[f].clipped;
  }
  if (!over_exposed) return false;
  for (const auto& [f, own] : grays) corrections.of_frame[f].grays = own;
  return true;
}

}  // namespace

FrameCorrections both(const FrameCorrections& first, const FrameCorrections& then) {
  FrameCorrections both = first;
  for (size_t k = 0; k < kGhosts; ++k) both.ghost[k] += then.ghost[k];
  for (size_t f = 0; f < both.of_frame.size(); ++f) {
    FrameCorrection& own = both.of_frame[f];
    if (then.of_frame[f].grays.gray >= 0) own.grays = then.of_frame[f].grays;
    for (size_t c = 0; c < kChannels; ++c) {
      own.offset[c] += own.gain[c] * then.of_frame[f].offset[c];
      own.gain[c] *= then.of_frame[f].gain[c];
    }
  }
  return both;
}

std::optional<SteadyLight> more_steady_light(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const ComparedFrames& compared,
                                             const FrameReport& report, const SteadyLight& known) {
  if (known.rounds >= kMaxRounds) return std::nullopt;
  Removed removed{.again = known.rounds > 0};
  const Quarters quarters(manifest, compared, removed);
  removed.ghosts = report.has_ghosts && quarters.say_ghosts(report);
  removed.flare = report.has_flare && quarters.say_flare(report);
  FrameCorrections own = without(report, removed);
  const bool over_exposed = take_grays(manifest, report, frames, own);
  if (!removed.ghosts && !removed.flare && !over_exposed) return std::nullopt;
  SteadyLight steady = known;
  ++steady.rounds;
  steady.grays = steady.grays || over_exposed;
  if (removed.ghosts) steady.ghost += report.ghost_share();
  if (removed.flare) steady.flare += report.flare.value;
  steady.corrections = std::make_shared<const FrameCorrections>(
      known.corrections ? both(*known.corrections, own) : std::move(own));
  return steady;
}

std::vector<std::string> warnings_of(const SteadyLight& steady) {
  std::vector<std::string> texts;
  if (steady.grays)
    texts.emplace_back(
        "white is over-exposed; its light is taken from the gray pictures: reduce the exposure");
  if (steady.ghost != 0.0) {
    texts.push_back(
        fmt::format("{:.1f} % of the previous picture remains in every frame: the monitor had not settled "
                    "when the camera "
                    "exposed; removed (`glasswing calibrate sync` measures how long to wait)",
                    100.0 * steady.ghost));
  }
  if (steady.flare != 0.0) {
    texts.push_back(fmt::format(
        "{:.1f} % of a picture's mean light is spread over all of it: flare in the lens, or light back from "
        "the room; removed",
        100.0 * steady.flare));
  }
  return texts;
}

}  // namespace glasswing
