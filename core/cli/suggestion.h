// What somebody may have meant by a word that is none of the known ones.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

// The candidate that takes the fewest edits (a character added, dropped, replaced, or swapped with the next),
// if at most a third of the word's characters need one; empty: none is near.
std::string nearest(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace glasswing
