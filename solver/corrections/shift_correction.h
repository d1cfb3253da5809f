// Undoes a knock: frames from there on are moved to where the others show the same.
#pragma once

#include <absl/status/status.h>

#include <vector>

#include "solver/corrections/frame_corrections.h"

namespace glasswing {

// Adds to `faults` what the shifts of a report show; a knock is undone if little of it remains then.
absl::Status correct_shifts(const v1::CaptureManifest& manifest, const std::vector<int>& frames,
                            const CorrectedReader& read, const FrameReport& report, FrameFaults& faults);

}  // namespace glasswing
