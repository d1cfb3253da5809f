// What is compared: methods, each with the captures of more and more images that it solves.
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
  std::function<absl::StatusOr<MadeCapture>(const RenderedScene&)> capture;
};

// By family, fewest images first.
std::vector<Candidate> candidates();

// The background without the object: what all are to surpass.
inline constexpr const char* kBare = "bare background";

}  // namespace glasswing
