// The least-squares fit behind CameraResponse; camera_response.h has the equation.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/radiometry/camera_response.h"

namespace glasswing {

// An unclipped code of one pixel in one frame.
struct CodeSample {
  int frame = 0;
  float code = 0.0f;      // full scale 1
  float gradient = 0.0f;  // of the code, per px
};

// The samples of one channel. Pixel i has samples [first[i], first[i + 1]), at least two.
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
