// A solved scene with its time and flags.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "core/matte/matte.h"
#include "solver/method/method.h"

namespace glasswing {

struct Solved {
  Matte matte;
  double seconds = 0.0;  // on all cores
  // Shares of the object's pixels with any flag, and by reason.
  double flagged = 0.0, unsettled = 0.0, saturated = 0.0, poor = 0.0;
  std::string text() const;
};

absl::StatusOr<Solved> solve(const Method& method, const v1::CaptureManifest& manifest,
                             const FrameStack& stack);

}  // namespace glasswing
