// The interface to an electrical line that starts a camera's exposures.
#pragma once

#include <absl/status/status.h>

namespace glasswing {

class TriggerLine {
 public:
  virtual ~TriggerLine() = default;
  // Raises the line now, and returns once it is low again, a few milliseconds later.
  virtual absl::Status pulse() = 0;
};

}  // namespace glasswing
