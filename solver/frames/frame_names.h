// Readable names of frames: "frame 12", "frames 212 to 240 and 250".
#pragma once

#include <string>
#include <vector>

namespace glasswing {

// `frames` are of `order`, in which neighbours form a range; not empty. At most four ranges.
std::string names_of(const std::vector<int>& frames, const std::vector<int>& order);

}  // namespace glasswing
