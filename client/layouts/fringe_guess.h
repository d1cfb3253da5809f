// What speaks for and against the steps of fringes (layout_guess.h).
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/layouts/layout_guess.h"
#include "client/layouts/layout_span.h"
#include "client/layouts/pattern_view.h"

namespace glasswing {

// What speaks against fringes in these photographs; empty: nothing.
std::string against_fringes(const PatternView& view, const PhotographLayout& layout, const LayoutSpan& span,
                            const std::vector<std::string>& files);

// Holds the periods that were given to the pictures, and settles the direction of the steps. Adds the
// reasons. INVALID_ARGUMENT: the pictures contradict or do not tell, and which options settle it.
absl::Status settle_fringes(const PatternView& view, const std::vector<LayoutSpan>& spans,
                            const v1::Monitor& monitor, const FringeFacts& facts, PhotographLayout& layout,
                            std::vector<std::string>& reasons);

}  // namespace glasswing
