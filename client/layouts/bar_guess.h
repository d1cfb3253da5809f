// What speaks for and against bars, of a Gray code or a binary one (layout_guess.h).
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/layouts/layout_span.h"
#include "client/layouts/pattern_view.h"

namespace glasswing {

// What speaks against bars in these photographs; empty: nothing.
std::string against_bars(const PatternView& view, const PhotographLayout& layout, const LayoutSpan& span,
                         const std::vector<std::string>& files);

// Gray code or binary, and whether complements come before or after their pattern. Adds the reasons.
// INVALID_ARGUMENT: the pictures do not tell, and which options do.
absl::Status settle_bars(const PatternView& view, const std::vector<LayoutSpan>& spans,
                         PhotographLayout& layout, std::vector<std::string>& reasons);

}  // namespace glasswing
