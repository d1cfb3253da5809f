// Mattes too large to be shown pixel by pixel.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string_view>

#include "core/matte/matte.h"
#include "core/matte/matte_file.h"

namespace glasswing {

struct SampledMatte {
  int step = 1;
  MatteOutline outline;  // of the whole
  Matte matte;           // the pixels of every `step`-th row and column
  PixelCount pixels;     // of the whole
};

// Reads a matte's file, pyramids included, a few rows at a time, `step` by sampling_step(). Errors are those
// of decode_matte().
absl::StatusOr<SampledMatte> sample_matte(std::string_view file, std::int64_t max_pixels);

}  // namespace glasswing
