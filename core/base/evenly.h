// Some of many, evenly.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace glasswing {

// So many of them, or all.
template <typename T>
std::vector<T> some_of(std::vector<T> all, size_t count) {
  if (all.size() <= count) return all;
  std::vector<T> some;
  for (size_t i = 0; i < count; ++i) some.push_back(std::move(all[i * all.size() / count]));
  return some;
}

}  // namespace glasswing
