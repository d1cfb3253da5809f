// Rays of two sessions' mattes, as the page plays them and as a file (docs/rays.md).
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "glasswing/v1/rays.pb.h"

namespace glasswing {

inline constexpr size_t kMaxSampledRays = 600;  // that the page draws in space

// Matching takes some 3.8 kB of memory a pixel, and up to 300 bytes a mode.
struct RayLimits {
  std::int64_t pixels = 320'000;   // of a matte
  std::int64_t modes = 4'000'000;  // of the object, in both mattes
};
// So that rays take at most an eighth of a machine's memory; the above where that is large.
RayLimits ray_limits(std::int64_t memory_bytes);

struct RayDepth {
  std::string session;
  std::string pose;       // in the geometry
  std::string_view file;  // the matte's; rows and columns may be left out (MatteMetadata.sampling_px)
};

// A geometry's text. INVALID_ARGUMENT names the line, or the value.
absl::StatusOr<v1::RigGeometry> geometry_in(const std::string& text);

// One line of JSON, and then the planes of a web matte (docs/console.md). Takes a while and all cores. Errors
// are those of decode_matte(), with the session, and of match_rays(). RESOURCE_EXHAUSTED: more than
// `limits.modes`.
absl::StatusOr<std::string> rays_to_play(const v1::RigGeometry& geometry,
                                         const std::array<RayDepth, 2>& depths, const RayLimits& limits,
                                         bool lossless);
// The file that `glasswing rays` writes. FAILED_PRECONDITION: the mattes are not whole.
absl::StatusOr<std::string> file_of_rays(const v1::RigGeometry& geometry,
                                         const std::array<RayDepth, 2>& depths, const RayLimits& limits);

}  // namespace glasswing
