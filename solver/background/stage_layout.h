// Which frames tell the object from the stage behind it, for whatever method.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "solver/method/exposure_merge.h"

namespace glasswing {

struct StageLayout {
  // The same stimulus with and without the object.
  struct Pair {
    Shot object, empty;
  };
  std::vector<Pair> pairs;
  Shot black;  // with the object; empty if it was not taken
  // Frames between which nothing but an id patch changes.
  std::vector<std::vector<int>> patches;
};

// The radiance of a channel's light, in [0, 1]: no colour is white.
double colour_of(const v1::Stimulus& stimulus, int channel);
// The one value of a gray stimulus; negative if it has a colour.
double gray_of(const v1::Stimulus& stimulus);
// The monitor's place in the manifest; -1: it lists none of that name.
int texture_of(const v1::CaptureManifest& manifest, const std::string& panel);

StageLayout lay_out_stage(const v1::CaptureManifest& manifest, const Exposures& exposures);

// FAILED_PRECONDITION: black was not taken.
absl::Status check_black(const StageLayout& layout);

// Every frame that the layout names, and those that tell of the empty stage (empty_stage.h).
std::vector<int> frames_of(const StageLayout& layout, const v1::CaptureManifest& manifest);

}  // namespace glasswing
