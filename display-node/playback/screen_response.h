// Turns a pattern's radiance into a screen's codes: through the screen's calibration, with dither
// (core/radiometry/dither), or by rounding if there is none and the screen counts as linear.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/repeated_ptr_field.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/radiometry/dither.h"
#include "display-node/display.h"
#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// For each screen the dither from its calibration; empty: it has no calibration. INVALID_ARGUMENT: a
// calibration of no screen, or a second one of the same screen; with different bits or a different size from
// the screen's pattern; for a screen with more than 12 bits; with a different format version; or with invalid
// tables.
absl::StatusOr<std::vector<std::optional<Dither>>> dithers_of(
    const google::protobuf::RepeatedPtrField<v1::DisplayCalibration>& calibrations,
    const std::vector<ScreenInfo>& screens);

// code = round(radiance x highest code), with radiance clamped to [0, 1] and NaN taken as 0. `codes` has
// 3 width height elements.
void round_to_codes(const Dither::Rows& radiance, int width_px, int bits, std::span<std::uint16_t> codes);

// "back, left"
std::string names_of(const std::vector<ScreenInfo>& screens);

}  // namespace glasswing
