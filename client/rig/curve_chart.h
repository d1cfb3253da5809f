// A device's curves as a picture: SVG, to be looked at in a browser.
#pragma once

#include <string>

#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// Above: light over code, r, g, b, with the codes that were measured. Below: what each curve differs from the
// law nearest to it (a straight line or a power), in percent of full scale, between three standard errors to
// either side.
std::string chart_of(const v1::CameraCalibration& calibration);
std::string chart_of(const v1::DisplayCalibration& calibration);

}  // namespace glasswing
