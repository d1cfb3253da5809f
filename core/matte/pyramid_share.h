// The part of an object that pyramids show (Matte::pyramids): what readers of modes alone lose.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "core/matte/matte.h"

namespace glasswing {

struct PyramidShare {
  std::int64_t object = 0, pixels = 0;    // of the object, and those of them with pyramids
  double light = 0.0, in_pyramids = 0.0;  // weights of all footprints of the object, and of its pyramids

  PyramidShare& operator+=(const PyramidShare& other);
};
PyramidShare pyramid_share(const Matte& matte);
// Of a file; nothing is decoded if it has no pyramids. Errors: decode_matte()'s.
absl::StatusOr<PyramidShare> pyramid_share(std::string_view file);

// For users: "12.0 % of the object's pixels, with 11.5 % of its light, have footprints of any shape, which
// STMaps cannot hold: they show the closest Gaussians"; empty if there are none. `holders`: a plural.
std::string lost_text(const PyramidShare& share, std::string_view holders);

// That on standard error, as a warning.
absl::Status tell_lost(std::string_view file, std::string_view holders);
void tell_lost(const PyramidShare& share, std::string_view holders);

}  // namespace glasswing
