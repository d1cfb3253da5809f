// How much later than reported a monitor shows its pictures, from the pixels of its id patch.
//
// The patch shows learning id i during [from_i + T, until_i + T], where from_i and until_i are reported and T
// is to be found. At a trial lag L each id is looked for in the frame whose exposure lies in [from_i + L,
// until_i + L], closest to the middle. All ids are seen if L is near T, equally far below and above T: T is
// the middle of those L.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/timing/proof.h"

namespace glasswing {

constexpr nanoseconds kEarliestLag = std::chrono::milliseconds(-100),
                      kLatestLag = std::chrono::milliseconds(200);

// Rig time, as reported.
struct TimeOnScreen {
  nanoseconds from{}, until{};
};

// Whether frames of these sequences, one for each learning id in order, show the patch.
using SeesPatch = std::function<absl::StatusOr<bool>(const std::vector<std::int64_t>&)>;

// T to about a quarter of the frames' period; none: no lag between kEarliestLag and kLatestLag shows every
// id. `ids`: one for each learning id, in order. `frames` cover those times plus kLatestLag. Errors are those
// of `sees`.
absl::StatusOr<std::optional<nanoseconds>> find_lag(std::span<const TimeOnScreen> ids,
                                                    std::span<const FrameTime> frames, const SeesPatch& sees);

}  // namespace glasswing
