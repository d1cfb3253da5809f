// The least squares behind CameraResponse; its header has the equation.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/radiometry/camera_response.h"

namespace glasswing {

// One pixel's code in one frame, not clipped.
struct CodeSample {
  int frame = 0;
  float code = 0.0f;      // full scale 1
  float gradient = 0.0f;  // of the code, per px
};

// What is known of one channel. Pixel i has samples [first[i], first[i + 1]), at least two.
struct ChannelSamples {
  std::vector<CodeSample> samples;
  std::vector<size_t> first = {0};
};

struct ResponseFit {
  std::array<std::array<double, CameraResponse::kKnots>, 3> exposures;  // 1 at the saturation level
  std::array<std::array<double, CameraResponse::kKnots>, 3> errors;
  std::vector<double> exposures_s;
};

ResponseFit fit_response(const std::array<ChannelSamples, 3>& channels, std::span<const double> declared_s,
                         const ResponseOptions& options);

}  // namespace glasswing
