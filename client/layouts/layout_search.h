// Searches all orders of blocks for the layout that fits the photographs best.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "client/layouts/layout_costs.h"
#include "client/layouts/layout_span.h"

namespace glasswing {

enum class LayoutFamily { kBars, kFringes, kBarsAndFringes };
inline constexpr std::array kLayoutFamilies{LayoutFamily::kBars, LayoutFamily::kFringes,
                                            LayoutFamily::kBarsAndFringes};

struct LayoutReading {
  LayoutFamily family = LayoutFamily::kBars;
  std::vector<LayoutSpan> spans;
  bool pairs = false;        // bars come with complements
  int steps = 0, waves = 0;  // of fringes
  double cost = 0.0;         // of layout_costs.h

  int bits(const LayoutSpan& span) const { return pairs ? span.count / 2 : span.count; }
};

// Interpretations in a family that are within `margin` of its best one and at most `most`, best first.
// `own_bits`: of the monitor, along x and y, which cost less than others.
std::vector<LayoutReading> search_layouts(LayoutCosts& costs, LayoutFamily family,
                                          const std::array<int, 2>& own_bits, double most, double margin);

}  // namespace glasswing
