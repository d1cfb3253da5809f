// Charts of a device's curves, as SVG.
#pragma once

#include <string>

#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// The upper panel shows light over code for r, g, b, over the measured codes. The lower one shows how far
// each curve deviates from the nearest law (a straight line or a power), in percent of full scale, with bands
// of three standard errors.
std::string chart_of(const v1::CameraCalibration& calibration);
std::string chart_of(const v1::DisplayCalibration& calibration);

}  // namespace glasswing
