// A block of a layout and its photographs.
#pragma once

#include <string>
#include <vector>

#include "client/layouts/photograph_layout.h"

namespace glasswing {

struct LayoutSpan {
  LayoutBlock block = LayoutBlock::kColumns;
  int first = 0, count = 0;

  size_t axis() const { return axis_of(block); }
  // "00.png to 19.png"
  std::string range(const std::vector<std::string>& files) const {
    const std::string& one = files[first];
    return count == 1 ? one : one + " to " + files[first + count - 1];
  }
};

}  // namespace glasswing
