#include "solver/fringe/fringe_method.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/pattern/method_options.h"
#include "solver/fringe/fringe_solver.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<Method>> FringeMethod::create(const MethodOptions& options) {
  auto method = std::make_unique<FringeMethod>();
  method->options_ = options;
  for (const auto& [key, value] : options) {
    if (key == "modes") {
      GW_ASSIGN_OR_RETURN(const double modes, number_option(key, value, 1, kMaxModes));
      method->modes_ = static_cast<int>(modes);
    } else if (key == "tolerance") {
      GW_ASSIGN_OR_RETURN(method->tolerance_, number_option(key, value, 0.0, 0.5));
    } else if (key == "silhouette_tolerance") {
      GW_ASSIGN_OR_RETURN(method->silhouette_tolerance_, number_option(key, value, 0.0, 1.0));
    } else {
      return unknown_option("fringe", key);
    }
  }
  return method;
}

absl::StatusOr<std::vector<int>> FringeMethod::frames_needed(const v1::CaptureManifest& manifest) const {
  GW_ASSIGN_OR_RETURN(const FringeLayout layout, lay_out_fringes(manifest));
  return frames_of(layout, manifest);
}

absl::StatusOr<Matte> FringeMethod::solve(const FrameStack& stack) const {
  GW_ASSIGN_OR_RETURN(const FringeLayout layout, lay_out_fringes(stack.manifest));
  GW_RETURN_IF_ERROR(check_rows(stack, frames_of(layout, stack.manifest)));
  const int monitors = static_cast<int>(layout.object.size());
  if (monitors > kMaxModes) {
    return absl::FailedPreconditionError(
        fmt::format("{} monitors showed sinusoids; at most {} can be solved", monitors, kMaxModes));
  }
  const int most = std::min(modes_, kMaxModes / monitors);
  Matte matte = blank_matte(stack, "fringe", options_, most * monitors);
  FringeSolver solver(stack, layout, most, tolerance_, silhouette_tolerance_);
  for (int y = 0; y < stack.row_count; ++y) solver.solve_row(y, matte);
  return matte;
}

}  // namespace glasswing
