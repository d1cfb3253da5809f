// The middle value of several, each of equal or of its own weight.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace glasswing {

// Of an even number, the larger of the two in the middle; 0 of none. Reorders the values.
template <typename T>
T median_in_place(std::span<T> values) {
  if (values.empty()) return T(0);
  const auto middle = values.begin() + values.size() / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

template <typename T>
T median(std::vector<T> values) {
  return median_in_place(std::span<T>(values));
}

using WeightedValues = std::vector<std::pair<double, double>>;  // values with their weights

// The least value that, with those below, has half of all weight; 0 of none.
inline double weighted_median(WeightedValues values) {
  std::ranges::sort(values);
  double left = 0.0;
  for (const auto& [value, weight] : values) left += 0.5 * weight;
  for (const auto& [value, weight] : values) {
    left -= weight;
    if (left <= 0.0) return value;
  }
  return values.empty() ? 0.0 : values.back().first;
}

}  // namespace glasswing
