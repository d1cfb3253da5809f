#include "core/cli/suggestion.h"

#include <algorithm>

namespace glasswing {
namespace {

// Optimal string alignment distance.
size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::vector<size_t>> count(a.size() + 1, std::vector<size_t>(b.size() + 1));
  for (size_t i = 0; i <= a.size(); ++i) {
    for (size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        count[i][j] = i + j;
        continue;
      }
      const size_t replaced = count[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      count[i][j] = std::min({count[i - 1][j] + 1, count[i][j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        count[i][j] = std::min(count[i][j], count[i - 2][j - 2] + 1);
    }
  }
  return count[a.size()][b.size()];
}

}  // namespace

std::string nearest(std::string_view word, const std::vector<std::string>& candidates) {
  std::string found;
  size_t least = word.size() / 3 + 1;
  for (const std::string& candidate : candidates) {
    const size_t count = edits(word, candidate);
    if (count >= least) continue;
    least = count;
    found = candidate;
  }
  return found;
}

}  // namespace glasswing
