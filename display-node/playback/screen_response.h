// From a pattern's radiance to a screen's codes: through the screen's calibration, with dither
// (core/radiometry/dither), or, for a screen that is taken for linear, rounded.
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

// For each screen the dither that its calibration makes; none: there is no calibration of it.
// INVALID_ARGUMENT: one of no screen, or a second one of the same; of other bits or another size than the
// screen's pattern; of a screen of more than 12 bits; of another format version; or tables that are none.
absl::StatusOr<std::vector<std::optional<Dither>>> dithers_of(
    const google::protobuf::RepeatedPtrField<v1::DisplayCalibration>& calibrations,
    const std::vector<ScreenInfo>& screens);

// Code = radiance times the highest code, to the nearest; beyond [0, 1] the nearest end, NaN is 0. `codes`
// has 3 width height of them.
void round_to_codes(const Dither::Rows& radiance, int width_px, int bits, std::span<std::uint16_t> codes);

// "back, left"
std::string names_of(const std::vector<ScreenInfo>& screens);

}  // namespace glasswing
