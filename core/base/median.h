// The middle value of several.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace glasswing {

// Of an even number, the larger of the two in the middle; 0 of none. Reorders the values.
template <typename T>
T median_in_place(std::span<T> values) {
  if (values.empty()) return T(0);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

template <typename T>
T median(std::vector<T> values) {
  return median_in_place(std::span<T>(values));
}

}  // namespace glasswing
