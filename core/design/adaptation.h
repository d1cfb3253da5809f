// Adaptive captures (Plan.adapt): how well a draft of all images determines the object, and what to show
// next. next_round.h has the equations.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <span>
#include <vector>

#include "core/design/next_round.h"
#include "core/matte/matte.h"
#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/plan.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// What a solve knows about one pixel's strongest channel, by texture. It has no modes on a monitor that it
// does not see.
using JudgedPixel = std::vector<KnownPixel>;
// Adds the object's pixels of some of a matte's rows, every `step`-th from column `first_x` on.
void add_pixels_of_object(const Matte& rows, int first_x, int step, size_t monitors,
                          std::vector<JudgedPixel>& pixels);

// One camera's draft.
struct JudgedView {
  std::vector<JudgedPixel> pixels;  // of the object; must not be empty
  v1::Camera camera;
};

struct Adaptation {
  std::vector<v1::AdaptedRound> found;  // by view
  std::optional<v1::Round> next;        // none: the target holds, or there may be no more images
};

// `views`: of one capture; at most 500 pixels of each are judged, evenly spaced. There is a next round until
// the target holds for every view; pixels of all views for which it does not, equally many of each, choose
// it. `waves`: candidates for the next round; empty: any. INVALID_ARGUMENT: the monitors do not fit the plan.
absl::StatusOr<Adaptation> adapt(std::vector<JudgedView> views, const v1::Plan& plan,
                                 const std::vector<v1::Monitor>& monitors,
                                 std::span<const DesignedWave> waves = {});

}  // namespace glasswing
