// The brightness of each monitor in every frame of a session, from white and black frames that the plan
// repeats (Plan.white_every):
//
//   brightness(t) = (white(t) - black(t)) / (white - black),    each over its exposure
//
// where the denominator is the session's first white. Linear between the times of the whites; constant before
// the first and after the last.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Reads one row of the picture from each of these frames (indices in the manifest), one after another: r, g,
// b.
using RowReader =
    std::function<absl::StatusOr<std::vector<std::uint16_t>>(int row, const std::vector<int>& frames)>;

// Measures FrameStack::brightness. Every tile uses the same sixteen rows, so that tiles join; the median of
// their ratios makes a row that sees an id patch harmless. Whites with and without the object differ: each is
// relative to the first of its kind. Empty if no white was repeated or times are unknown. Whites too dark or
// too bright for half a percent of accuracy are skipped. Without repeated whites, changes of the camera's
// exposure, by channel (exposure_changes.h). FAILED_PRECONDITION: a white changed by more than a fifth, or a
// frame's exposure by more than 30 %.
absl::StatusOr<std::vector<std::array<float, 3>>> measure_brightness_drift(
    const v1::CaptureManifest& manifest, const RowReader& read);

}  // namespace glasswing
