// Ghosts of the last pictures, flare and over-exposed white: effects that are the same in all frames, and
// distort the reference for everything else.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "solver/frames/frame_report.h"
#include "solver/method/frame_correction.h"

namespace glasswing {

struct SteadyLight {
  std::shared_ptr<const FrameCorrections> corrections;  // null: none
  double ghost = 0.0, flare = 0.0;
  bool grays = false;
  int rounds = 0;  // in which some was found
};

// `known`, updated with what the report of the frames corrected by it shows; nothing if that shows nothing
// more, or after a few rounds. Otherwise the frames must be compared again.
std::optional<SteadyLight> more_steady_light(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const ComparedFrames& compared,
                                             const FrameReport& report, const SteadyLight& known);

std::vector<std::string> warnings_of(const SteadyLight& steady);

// What two corrections remove, one after the other. `then` sees light that `first` has corrected.
FrameCorrections both(const FrameCorrections& first, const FrameCorrections& then);

}  // namespace glasswing
