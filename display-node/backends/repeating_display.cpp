#include "display-node/backends/repeating_display.h"

#include <algorithm>

#include "core/base/status.h"

namespace glasswing {

absl::StatusOr<std::vector<Scanout>> RepeatingDisplay::show(const std::vector<Picture>& pictures,
                                                            nanoseconds at) {
  if (!repeat_(random_)) return display_.show(pictures, at);
  nanoseconds longest{};
  for (const ScreenInfo& screen : screens()) longest = std::max(longest, period_of(screen));
  GW_ASSIGN_OR_RETURN(std::vector<Scanout> scanouts,
                      display_.show(pictures, std::max(at, monotonic_now()) + longest));
  for (size_t m = 0; m < scanouts.size(); ++m) scanouts[m].start -= period_of(screens()[m]);
  return scanouts;
}

}  // namespace glasswing
