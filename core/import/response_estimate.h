// Estimates the undeclared response of photographs from what the monitor showed. Light is additive: the light
// of some photographs is a known sum of others' at every pixel, whatever the object does:
//
//   complements   f(a) + f(b) = f(white) + f(black); so for steps of fringes half a period apart, and for any
//                 two pairs of complements
//   levels        f(gray) = level f(white) + (1 - level) f(black)
//   exposures     f(a) / time_a = f(b) / time_b
//
// f(u) = u^G or sRGB's curve is the one with the smallest residual: the smallest mean of Huber's function of
// sum / (noise of the sum), with noise of a code of 255. Blurred edges are informative, pixels that are white
// or black in all photographs are not. If the monitor's own curve is not linear, gray levels and fringes show
// both curves together.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct ResponseEstimate {
  std::string response;  // of PhotographResponse; empty: the photographs do not tell
  double gamma = 0.0;    // the best G, also where that is close enough to "linear"
  double error = 0.0;    // scatter of G over relations and parts of the pictures, a standard deviation
  std::string reason;    // what it is estimated from, or why it is not
};

// `codes`: by frame of the manifest, the same pixels of each, 1 = the highest code. `black`: on the same
// scale.
ResponseEstimate estimate_response(const v1::CaptureManifest& manifest,
                                   const std::vector<std::vector<float>>& codes, double black);

}  // namespace glasswing
