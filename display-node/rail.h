// The interface to a linear stage that carries a monitor towards the camera and away from it.
#pragma once

#include <absl/status/status.h>

#include <memory>
#include <optional>
#include <stop_token>
#include <string>

namespace glasswing {

class Rail {
 public:
  virtual ~Rail() = default;
  // Moves the monitor, and returns when it has arrived. The position is within the rail's range. After an
  // error it may be anywhere.
  virtual absl::Status move(double position_mm, std::stop_token stop) = 0;
};

// A monitor's rail. Positions are on the rail's own scale.
struct MonitorRail {
  std::string monitor;
  double min_mm = 0.0, max_mm = 0.0;
  std::optional<double> position_mm;  // empty: unknown
  std::unique_ptr<Rail> rail;         // not null
};

}  // namespace glasswing
