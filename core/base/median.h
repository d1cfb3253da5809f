// The middle value of several, with equal or individual weights.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace glasswing {

// For an even number, the larger of the two in the middle; 0 for none. Reorders the values.
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

// The smallest value that, with those below it, has half of the total weight; 0 for none.
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
