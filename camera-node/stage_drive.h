// The seam to the motors of a stage with one or more axes, such as a turntable.
#pragma once

#include <absl/status/status.h>

#include <memory>
#include <stop_token>
#include <string>
#include <vector>

namespace glasswing {

struct StageAxis {
  std::string name;   // "turn"
  bool turns = true;  // positions are degrees; else mm
  double min = 0.0, max = 0.0;
  std::string letter;  // of G-code; empty: by its place among the axes

  const char* unit() const { return turns ? "deg" : "mm"; }
};

// One call at a time. An axis may stand anywhere after an error.
class StageDrive {
 public:
  virtual ~StageDrive() = default;
  // Moves an axis, and returns when it stands there. CANCELLED: `stop` was requested, and the axis is at rest
  // or comes to rest.
  virtual absl::Status move(const StageAxis& axis, double position, std::stop_token stop) = 0;
  // Whether it can find position 0 of an axis by itself.
  virtual bool homes() const { return true; }
  // Moves an axis to its position 0. CANCELLED: as move().
  virtual absl::Status home(const StageAxis& axis, std::stop_token stop) = 0;
};

struct StageDevice {
  std::vector<StageAxis> axes;        // names differ
  std::unique_ptr<StageDrive> drive;  // null: there are no axes
  bool homes_first = true;            // an axis that does not know where it stands is homed before it moves
  int settle_ms = 0;                  // after a move
  double takeup = 0.0;  // how far moves go beyond from above, to come from below like all others
};

}  // namespace glasswing
