// Amounts in the words of a command line.
#pragma once

#include <string>

namespace glasswing {

// "22.9 MB"
std::string bytes_text(double bytes);

}  // namespace glasswing
