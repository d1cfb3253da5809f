// --layout auto: detects which layout a stack of photographs follows from the pictures. Whole layouts
// compete: a Gray code or a binary one with or without complements, phase-shifted fringes of one period or
// more, and fringes beside a code, each by columns or rows first, with white and black in any position or not
// at all. The one whose photographs fit best (layout_costs.h) wins, if it fits well and no other fits nearly
// as well. The number of bits is free: a code whose size differs from the monitor's is recognised, and the
// size is asked for.
//
// Gray codes and binary ones differ where the coarser bars have an edge: there the next finer ones of a Gray
// code are lit on both sides, and those of a binary code have an edge too. Edges also lie at the same phase
// of fringes that accompany a code, which tells their direction and their first phase.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/layouts/photograph_layout.h"
#include "client/layouts/stack_samples.h"

namespace glasswing {

// What pictures cannot show.
struct LayoutFacts {
  std::vector<FringePeriod> periods{};  // empty: not given
  std::optional<bool> backward{};
  std::optional<double> cell_px{};
};

struct LayoutGuess {
  std::vector<std::string> reasons;  // what the pictures show, also where that does not settle the layout
  // INVALID_ARGUMENT: what is ambiguous, and which options resolve it.
  absl::StatusOr<PhotographLayout> layout;
};

// `files` name the photographs of the samples.
LayoutGuess guess_layout(const StackSamples& samples, const std::vector<std::string>& files,
                         const v1::Monitor& monitor, const LayoutFacts& facts);

}  // namespace glasswing
