// --layout auto: which layout a stack of photographs follows, by what its pictures show. Every layout with as
// many patterns as there are photographs is tried; it fits if
//
//   - white and black are about as light and as dark as any photograph, all over;
//   - columns change along the pictures' x, rows along y;
//   - complements sum to a constant, and other neighbours do not;
//   - bars double their number from one to the next, or the steps of fringes lie on a sinusoid.
//
// Gray codes and binary ones differ where the coarser bars have an edge: there the next finer ones of a Gray
// code are lit on both sides, and those of a binary code have an edge too.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/layouts/photograph_layout.h"
#include "client/layouts/stack_samples.h"

namespace glasswing {

// What pictures of fringes cannot show.
struct FringeFacts {
  std::vector<FringePeriod> periods{};  // empty: not given
  std::optional<bool> backward{};
};

struct LayoutGuess {
  std::vector<std::string> reasons;  // what the pictures show, also where that does not settle the layout
  // INVALID_ARGUMENT: what could not be settled, and which options settle it.
  absl::StatusOr<PhotographLayout> layout;
};

// `files` name the photographs of the samples.
LayoutGuess guess_layout(const StackSamples& samples, const std::vector<std::string>& files,
                         const v1::Monitor& monitor, const FringeFacts& facts);

}  // namespace glasswing
