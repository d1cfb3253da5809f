// Bars and their inverse are together as light as white and black, at every pixel, whatever it sees: what
// tells of the light where no pixel sees the stage past the object.
#pragma once

#include <string>

#include "solver/frames/frame_report.h"

namespace glasswing {

// For users; empty if all agree, or nothing can be compared.
std::string bar_sums_warning(const v1::CaptureManifest& manifest, const ComparedFrames& compared);

}  // namespace glasswing
