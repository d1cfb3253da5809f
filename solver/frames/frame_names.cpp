#include "solver/frames/frame_names.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

namespace glasswing {

std::string names_of(const std::vector<int>& frames, const std::vector<int>& order) {
  constexpr size_t kMaxStretches = 4;
  const std::set<int> wanted(frames.begin(), frames.end());
  std::vector<std::pair<int, int>> stretches;
  bool open = false;
  for (const int frame : order) {
    const bool in = wanted.contains(frame);
    if (in && !open) stretches.emplace_back(frame, frame);
    if (in) stretches.back().second = frame;
    open = in;
  }
  std::vector<std::string> names;
  for (size_t i = 0; i < std::min(stretches.size(), kMaxStretches); ++i) {
    const auto& [first, last] = stretches[i];
    names.push_back(first == last ? fmt::format("{}", first) : fmt::format("{} to {}", first, last));
  }
  if (stretches.size() > kMaxStretches)
    names.push_back(fmt::format("{} more stretches", stretches.size() - kMaxStretches));
  std::string last;
  if (names.size() > 1) {
    last = " and " + names.back();
    names.pop_back();
  }
  return fmt::format("frame{} {}{}", frames.size() == 1 ? "" : "s", fmt::join(names, ", "), last);
}

}  // namespace glasswing
