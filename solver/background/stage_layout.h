// The frames that separate the object from the stage behind it, for every method.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "solver/background/empty_stage.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {

struct StageLayout {
  // The same stimulus with and without the object.
  struct Pair {
    Shot object, empty;
  };
  std::vector<Pair> pairs;
  // No frame shows an object: every pixel shows the stage, and its own samples show where it looks.
  bool bare = false;
  Shot black;  // with the object; empty if not recorded
  // Groups of frames that differ only in an id patch.
  std::vector<std::vector<int>> patches;
  std::vector<EmptyMonitor> monitors;  // by texture, with the frames of the empty stage
  v1::Camera camera;
};

// A channel's radiance, in [0, 1]; a stimulus without colour is white.
double colour_of(const v1::Stimulus& stimulus, int channel);
// The value of a gray stimulus; negative for a coloured one.
double gray_of(const v1::Stimulus& stimulus);
// The monitor's index in the manifest; -1: not listed.
int texture_of(const v1::CaptureManifest& manifest, const std::string& panel);

StageLayout lay_out_stage(const v1::CaptureManifest& manifest, const Exposures& exposures);

// Whether the object changes a pixel of the stack.
bool changed_by_object(const FrameStack& stack, const StageLayout& layout, const SilhouetteTest& test,
                       const SampleNoise& noise, int x, int y);

// FAILED_PRECONDITION: black was not recorded.
absl::Status check_black(const StageLayout& layout);

// Every frame listed in the layout.
std::vector<int> frames_of(const StageLayout& layout);

}  // namespace glasswing
