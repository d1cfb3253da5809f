// How bright each monitor was in every frame of a session, from white and black that were shown again and
// again (Plan.white_every):
//
//   brightness(t) = (white(t) - black(t)) / (white - black) of the session's first white,    each over its
//   exposure
//
// straight between the times of the whites, and as the nearest one before the first and after the last.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// One row of the picture from each of these frames (places in the manifest), one after another: r, g, b.
using RowReader =
    std::function<absl::StatusOr<std::vector<std::uint16_t>>(int row, const std::vector<int>& frames)>;

// FrameStack::brightness. It comes from the same sixteen rows for every tile, so that tiles join; the middle
// one of their ratios counts, so that a row that sees an id patch does no harm. With and without the object
// whites differ: each is relative to the first of its own. Empty where nothing was shown again, or when is
// not known. Whites that are too dark or too bright to tell half a percent are passed over.
// FAILED_PRECONDITION: a white that changed by more than a fifth.
absl::StatusOr<std::vector<float>> measure_brightness_drift(const v1::CaptureManifest& manifest,
                                                            const RowReader& read);

}  // namespace glasswing
