// How the light of a session's frames changes, from all evidence: what is divided out and subtracted, and
// what is reported to users.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "solver/corrections/quarters.h"
#include "solver/frames/frame_report.h"
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
