// A capture of other patterns than were recorded. Light is linear: what a camera sees of a weighted sum of
// patterns is the same sum of what it sees of each. So a pattern that is a sum of recorded ones needs no
// renderer and no rig. The noise is that of the sum, not of one exposure.
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
  int frame = 0;  // place in the recorded manifest
  double weight = 0.0;
};

struct MadeCapture {
  v1::CaptureManifest manifest;
  std::vector<std::vector<Part>> parts;  // what each frame of the manifest is the sum of

  void add(const v1::Frame& frame, std::vector<Part> made_of);
};

// As it was recorded, or those of its frames only.
MadeCapture as_recorded(const v1::CaptureManifest& recorded);
MadeCapture part_of(const v1::CaptureManifest& recorded, const std::function<bool(const v1::Frame&)>& wanted);

// The recorded frames of which any of these made ones is a sum.
std::vector<int> frames_of(const MadeCapture& capture, const std::vector<int>& made);

// Those made frames, on 16 bits, of the same rows of the recorded ones; saturated where one of them is.
FrameStack made_stack(const FrameStack& recorded, const MadeCapture& capture, const std::vector<int>& made);

// Makes smooth gray patterns of the stripes, white and black that were recorded with the object, so that
// every point of the monitor shows what the pattern would. Stripes overlap: weights may be negative, though
// the pattern's light is not.
class StripeSums {
 public:
  // The manifest must outlive it.
  explicit StripeSums(const v1::CaptureManifest& recorded) : recorded_(recorded) {}

  // Of a pattern whose light changes along phi_deg only, the direction in which the stripes travelled.
  // FAILED_PRECONDITION: there are none, or they are too wide for a pattern so fine.
  absl::StatusOr<std::vector<Part>> parts(const v1::Stimulus& wanted, double phi_deg);

 private:
  struct Basis;
  absl::StatusOr<std::shared_ptr<const Basis>> basis(const std::string& panel, double phi_deg, bool white);

  const v1::CaptureManifest& recorded_;
  std::map<std::tuple<std::string, double, bool>, std::shared_ptr<const Basis>> bases_;
};

}  // namespace glasswing
