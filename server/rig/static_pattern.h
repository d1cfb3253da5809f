// Shows still pictures on monitors until destroyed.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "glasswing/v1/stimulus.pb.h"
#include "server/rig/node_streams.h"

namespace glasswing {

class StaticPattern {
 public:
  // Returns when the pictures are on screen; other monitors are black. `calibrations`: for monitors that have
  // one. `rig` must outlive the object. CANCELLED: stopped. UNAVAILABLE: a node does not answer.
  static absl::StatusOr<std::unique_ptr<StaticPattern>> start(
      const RigLinks& rig, const std::vector<v1::Stimulus>& stimuli,
      const google::protobuf::RepeatedPtrField<v1::DisplayCalibration>& calibrations, std::stop_token stop);

  // OK while the pictures are on screen.
  absl::Status check() const;

 private:
  StaticPattern() = default;
  // The time by which every monitor of the display shows its picture, if told to begin at `start`.
  static nanoseconds there_at(const DisplayLink& display, nanoseconds start);

  std::vector<std::unique_ptr<PresentationStream>> playing_;
};

// A picture for framing, focusing and finding faults, on each of `monitors`: "white", "gray" (a fifth of the
// light), "bars" (8 vertical ones), "lines" (24, to focus on), "ramp" or "black". INVALID_ARGUMENT: another
// name.
absl::StatusOr<std::vector<v1::Stimulus>> test_pattern(const std::string& name,
                                                       const std::vector<v1::Monitor>& monitors);

}  // namespace glasswing
