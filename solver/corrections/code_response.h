// Frames that a manifest calls linear, but which are not: sums of light that should agree do not, unless the
// codes are interpreted as sRGB or a power (core/import/response_estimate.h).
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "solver/background/stage_maps.h"

namespace glasswing {

struct CodeResponse {
  std::string response;  // of PhotographResponse; empty: linear, calibrated, or not told
  std::string warning;   // for users
};

// Errors are those of `read`.
absl::StatusOr<CodeResponse> find_code_response(const v1::CaptureManifest& manifest,
                                                const std::vector<int>& frames, const LightReader& read);

}  // namespace glasswing
