// Amounts as text for the command line.
#pragma once

#include <string>

namespace glasswing {

// "22.9 MB"
std::string bytes_text(double bytes);

// A difference of two clocks in a suitable unit: "40 us", "-12.5 ms", "3.21 s", "5 min 12 s", "3 d 4 h".
std::string offset_text(double ns);

}  // namespace glasswing
