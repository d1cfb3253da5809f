// Bars plus their inverse are as bright as white plus black at every pixel, whatever it sees: this measures
// the light if no pixel sees the stage beside the object.
#pragma once

#include <string>

#include "solver/frames/frame_report.h"

namespace glasswing {

// For users; empty if all agree, or nothing can be compared.
std::string bar_sums_warning(const v1::CaptureManifest& manifest, const ComparedFrames& compared);

}  // namespace glasswing
