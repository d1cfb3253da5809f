// Helpers of the job stores' tests.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "server/jobs/job_store.h"

namespace glasswing {

// A result that took `seconds`.
inline TileResult result(const std::string& name, double seconds = 1.0) {
  return {.result = name, .object_pixels = 10, .flagged_pixels = 3, .unsolved_pixels = 2, .seconds = seconds};
}

// Ranges of 4 rows each.
inline std::vector<TileRange> ranges(int count) {
  std::vector<TileRange> ranges;
  for (int i = 0; i < count; ++i) ranges.push_back({.first = 4 * i, .count = 4});
  return ranges;
}

// Polls until it is true; false: not within half a minute.
inline bool comes_true(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

}  // namespace glasswing
