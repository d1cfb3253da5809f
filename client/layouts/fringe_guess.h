// What fringes show about their steps, periods and place (layout_guess.h).
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/layouts/bar_guess.h"
#include "client/layouts/layout_costs.h"
#include "client/layouts/layout_guess.h"
#include "client/layouts/layout_span.h"
#include "client/layouts/pattern_view.h"

namespace glasswing {

struct FringeEvidence {
  const std::vector<LayoutSpan>& spans;
  const BarsSeen& bars;  // without waves: there are fringes alone
  const v1::Monitor& monitor;
  const LayoutFacts& facts;
  const LayoutCosts& costs;  // know which photographs are bad
};

// Checks the given periods against the pictures, and determines the direction of the steps; with bars, also
// the first step's phase and the code's cells. Adds the reasons. INVALID_ARGUMENT: the pictures contradict
// them or are ambiguous; names the options that resolve it.
absl::Status settle_fringes(const PatternView& view, const FringeEvidence& evidence, PhotographLayout& layout,
                            std::vector<std::string>& reasons);

}  // namespace glasswing
