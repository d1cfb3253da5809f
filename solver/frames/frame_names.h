// Names of frames for people: "frame 12", "frames 212 to 240 and 250".
#pragma once

#include <string>
#include <vector>

namespace glasswing {

// `frames` are of `order`, in which neighbours belong together; not empty. At most four stretches.
std::string names_of(const std::vector<int>& frames, const std::vector<int>& order);

}  // namespace glasswing
