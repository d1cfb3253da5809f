// One matte of two objects that were captured apart, by the same camera before the same monitors: `front`
// hides `back` as far as it covers a pixel.
//
//   C = C_front - what passes beside it + (1 - alpha) C_back,     alpha: the coverage of `front`
//
// Where either does not cover a pixel, the other's stays. A pixel that `front` covers in part has a mode for
// what passes beside it on each monitor (docs/matte.md): of that monitor's, the one most like those of the
// nearest pixel that `front` leaves free, with 1 - alpha of their weight. Refraction of one object by the
// other is not shown: each was captured alone.
#pragma once

#include <absl/status/statusor.h>

#include "core/matte/matte.h"

namespace glasswing {

// Coverage is that of both, flags those of the pixels used. Modes that are more than kMaxModes are merged
// (mode_reduction.h). What the modes were fitted to stays if it is the same for both.
// INVALID_ARGUMENT names what differs: size, monitors, footprint, crosstalk, mosaic, or whether light is
// linear.
absl::StatusOr<Matte> merged(const Matte& front, const Matte& back);

}  // namespace glasswing
