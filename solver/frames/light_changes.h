// How the light of a session's frames changes, by all that tells of it: what is divided out and subtracted,
// and what users are told.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "solver/frames/frame_report.h"
#include "solver/frames/quarters.h"
#include "solver/method/frame_correction.h"

namespace glasswing {

struct LightChanges {
  std::optional<FrameCorrections> corrections;  // none: nothing is to be corrected
  std::vector<std::string> warnings;
};

LightChanges light_changes(const v1::CaptureManifest& manifest, const FrameReport& report,
                           const Quarters& quarters);

// Of these frames, none of which is changed yet.
FrameCorrections no_corrections(const FrameReport& report);

}  // namespace glasswing
