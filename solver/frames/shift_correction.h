// Takes a knock back: frames from there on are moved to where the others have what they show.
#pragma once

#include <absl/status/status.h>

#include <vector>

#include "solver/frames/frame_corrections.h"

namespace glasswing {

// Adds to `faults` what the shifts of a report tell; a knock is taken back if little of it is left then.
absl::Status correct_shifts(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                            const CorrectedReader& read, const FrameReport& report, FrameFaults& faults);

}  // namespace glasswing
