// Solving archives of any mixture of patterns, for method gaussian.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <vector>

#include "solver/method/method.h"

namespace glasswing {

struct MixtureLimits {
  int max_modes = 0;  // of a channel, over all monitors
  double silhouette_tolerance = 0.0;
};

// FAILED_PRECONDITION says what the archive lacks (lay_out_mixture).
absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare_mixture(const v1::CaptureManifest& manifest,
                                                                v1::MatteMetadata metadata,
                                                                const MixtureLimits& limits);

// Whether an archive's patterns with the object include sinusoids.
bool shows_sinusoids(const v1::CaptureManifest& manifest);

}  // namespace glasswing
