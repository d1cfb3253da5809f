// Shares the rows of a picture among threads.
#pragma once

#include <algorithm>
#include <thread>
#include <vector>

namespace glasswing {

// Calls work(first, last) for bands that together cover rows [0, height); returns when all are done.
// `thread_count` 0: all cores.
template <typename Work>
void for_rows(int height, int thread_count, const Work& work) {
  if (thread_count <= 0) thread_count = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int bands = std::clamp(thread_count, 1, std::max(1, height));
  std::vector<std::jthread> helpers;
  for (int band = 1; band < bands; ++band)
    helpers.emplace_back([&, band] { work(height * band / bands, height * (band + 1) / bands); });
  work(0, height / bands);
}

}  // namespace glasswing
