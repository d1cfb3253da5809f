// The known word that an unknown one may have been meant to be.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

// The candidate with the fewest edits (a character added, dropped, replaced, or swapped with the next), if at
// most a third of the word's characters need one; empty: none is close.
std::string nearest(std::string_view word, const std::vector<std::string>& candidates);

}  // namespace glasswing
