// What bars show about their code (layout_guess.h).
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <string>
#include <vector>

#include "client/layouts/layout_span.h"
#include "client/layouts/pattern_view.h"

namespace glasswing {

struct BarsSeen {
  // Per axis; 1: positions on the monitor rise along the pictures' axis; -1: they fall; 0: not seen.
  std::array<int, 2> direction{};
  std::array<std::vector<BarShots>, 2> waves;  // by axis, coarse to fine
};

// Gray code or binary, and whether complements come before or after their pattern. Adds the reasons.
// INVALID_ARGUMENT: the pictures do not determine it; names the options that do.
absl::StatusOr<BarsSeen> settle_bars(const PatternView& view, const std::vector<LayoutSpan>& spans,
                                     PhotographLayout& layout, std::vector<std::string>& reasons);

}  // namespace glasswing
