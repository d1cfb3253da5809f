#include "tests/results/solved.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "core/base/status.h"
#include "solver/worker/parallel_solve.h"

namespace glasswing {

std::string Solved::text() const {
  return fmt::format("{:.1f} s, {:.1f} % flagged ({:.1f} unsettled, {:.1f} saturated, {:.1f} poor)", seconds,
                     100.0 * flagged, 100.0 * unsettled, 100.0 * saturated, 100.0 * poor);
}

absl::StatusOr<Solved> solve(const Method& method, const v1::CaptureManifest& manifest,
                             const FrameStack& stack) {
  const auto start = std::chrono::steady_clock::now();
  GW_ASSIGN_OR_RETURN(Matte matte, solve_in_bands(method, manifest, stack));
  Solved solved{.matte = std::move(matte)};
  solved.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  double object = 0.0;
  for (int y = 0; y < solved.matte.height_px(); ++y) {
    for (int x = 0; x < solved.matte.width_px(); ++x) {
      if (solved.matte.coverage(x, y) <= 0.0f) continue;
      object += 1.0;
      const std::uint8_t flags = solved.matte.flags(x, y);
      solved.flagged += flags != kFlagNone ? 1.0 : 0.0;
      solved.unsettled += (flags & kFlagNotConverged) != 0 ? 1.0 : 0.0;
      solved.saturated += (flags & kFlagSaturated) != 0 ? 1.0 : 0.0;
      solved.poor += (flags & kFlagPoorFit) != 0 ? 1.0 : 0.0;
    }
  }
  for (double* share : {&solved.flagged, &solved.unsettled, &solved.saturated, &solved.poor}) {
    *share /= std::max(object, 1.0);
  }
  return solved;
}

}  // namespace glasswing
