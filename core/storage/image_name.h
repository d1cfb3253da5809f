// Uploaded pictures are called after what they hold.
#pragma once

#include <string>
#include <string_view>

namespace glasswing {

// Of the file below images/ with these bytes: "xxh3" and 16 hexadecimal digits.
std::string image_name(std::string_view bytes);

}  // namespace glasswing
