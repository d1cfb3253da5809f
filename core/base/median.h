// The middle value of several.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace glasswing {

// Of an even number, the larger of the two in the middle; 0 of none.
template <typename T>
T median(std::vector<T> values) {
  if (values.empty()) return T(0);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace glasswing
