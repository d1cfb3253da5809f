// Ghosts of the last pictures, flare and over-exposed white: what is alike in all frames, and blurs what all
// else is compared with.
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

// `known`, with what the report of frames that it corrects shows of it; nothing if that shows no more, or
// after a few rounds. Else the frames are to be compared again.
std::optional<SteadyLight> more_steady_light(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const ComparedFrames& compared,
                                             const FrameReport& report, const SteadyLight& known);

std::vector<std::string> warnings_of(const SteadyLight& steady);

// What two corrections take off, one after the other. `then` sees light that `first` has corrected.
FrameCorrections both(const FrameCorrections& first, const FrameCorrections& then);

}  // namespace glasswing
