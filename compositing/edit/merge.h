// One matte of two objects that were captured separately, by the same camera in front of the same monitors:
// `front` hides `back` as far as it covers a pixel.
//
//   C = C_front - light that passes beside it + (1 - alpha) C_back,     alpha: the coverage of `front`
//
// If one does not cover a pixel, the other's is used. A pixel that `front` covers partly has a mode on each
// monitor for the light that passes beside it (docs/matte.md): the mode on that monitor most similar to those
// of the nearest pixel that `front` leaves free, with 1 - alpha of their weight. Refraction of one object by
// the other is not shown: each was captured alone.
#pragma once

#include <absl/status/statusor.h>

#include "core/matte/matte.h"

namespace glasswing {

// Coverage is that of both together, flags are those of the pixels used. Modes beyond kMaxModes are merged
// (mode_reduction.h). The record of what the modes were fitted to is kept if it is the same for both.
// INVALID_ARGUMENT names what differs: size, monitors, footprint, crosstalk, mosaic, or whether light is
// linear.
absl::StatusOr<Matte> merged(const Matte& front, const Matte& back);

}  // namespace glasswing
