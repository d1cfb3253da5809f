// Option footprints=any of method gaussian: a second pass over pixels that Gaussians explain poorly.
#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "solver/method/method.h"

namespace glasswing {

// `gaussian`: the method as prepared for the same manifest; its modes stay as they are.
// FAILED_PRECONDITION: a mosaic, or lay_out_mixture() cannot use the archive.
absl::StatusOr<std::unique_ptr<PreparedMethod>> with_pyramids(std::unique_ptr<PreparedMethod> gaussian,
                                                              const v1::CaptureManifest& manifest);

}  // namespace glasswing
