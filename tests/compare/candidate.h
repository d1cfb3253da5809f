// The candidates of the comparison: methods, each with captures of increasingly many images.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/results/rendered_scene.h"

namespace glasswing {

struct Candidate {
  std::string family;   // a curve
  std::string variant;  // a point on it
  std::string method;
  MethodOptions options;
  std::function<absl::StatusOr<SynthesizedCapture>(const RenderedScene&)> capture;
};

// By family, in order of images.
std::vector<Candidate> candidates();

// The background without the object: the baseline.
inline constexpr const char* kBare = "bare background";

}  // namespace glasswing
