// Pixels that see the stage beside the object, whatever happened to the brightness between pictures with and
// without it: their samples of the same pictures follow a straight line,
//
//   with = a + b without,
//
// whose slope b is the one that most such pixels have.
#pragma once

#include <vector>

#include "solver/background/stage_layout.h"
#include "solver/frames/session_samples.h"

namespace glasswing {

// By pixel of the samples. None if there are fewer than three pictures of sufficient contrast with and
// without the object.
std::vector<bool> beside_object(const SessionSamples& samples, const v1::CaptureManifest& manifest,
                                const StageLayout& layout, double noise_sd);

}  // namespace glasswing
