// A capture of patterns that were never shown, synthesized from those that were recorded. Light is linear: a
// camera sees a weighted sum of patterns as the same sum of what it sees of each. A pattern that is a sum of
// recorded ones needs neither renderer nor rig. Its noise is that of the sum, not of one exposure.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "solver/method/method.h"

namespace glasswing {

struct Part {
  int frame = 0;  // index in the recorded manifest
  double weight = 0.0;
};

struct SynthesizedCapture {
  v1::CaptureManifest manifest;
  std::vector<std::vector<Part>> parts;  // of each frame of the manifest, the recorded frames that it sums

  void add(const v1::Frame& frame, std::vector<Part> summands);
};

// The recorded capture, or only the requested frames.
SynthesizedCapture as_recorded(const v1::CaptureManifest& recorded);
SynthesizedCapture part_of(const v1::CaptureManifest& recorded,
                           const std::function<bool(const v1::Frame&)>& wanted);

// The recorded frames that these synthesized ones sum.
std::vector<int> frames_of(const SynthesizedCapture& capture, const std::vector<int>& synthesized);

// These synthesized frames as 16-bit samples, for the same rows as the recorded ones. A sample is saturated
// where one of its summands is.
FrameStack synthesized_stack(const FrameStack& recorded, const SynthesizedCapture& capture,
                             const std::vector<int>& synthesized);

// Synthesizes smooth gray patterns from the stripes, white and black that were recorded with the object, so
// that every point of the monitor shows the pattern's light. Stripes overlap, so weights may be negative
// though the pattern's light is not.
class StripeSums {
 public:
  // Keeps a reference to the manifest.
  explicit StripeSums(const v1::CaptureManifest& recorded) : recorded_(recorded) {}

  // For a pattern whose light changes only along phi_deg, the direction in which the stripes travelled.
  // FAILED_PRECONDITION: no such stripes, or they are too wide for so fine a pattern.
  absl::StatusOr<std::vector<Part>> parts(const v1::Stimulus& wanted, double phi_deg);

 private:
  struct Basis;
  absl::StatusOr<std::shared_ptr<const Basis>> basis(const std::string& panel, double phi_deg, bool white);

  const v1::CaptureManifest& recorded_;
  std::map<std::tuple<std::string, double, bool>, std::shared_ptr<const Basis>> bases_;
};

}  // namespace glasswing
