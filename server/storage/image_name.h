// Uploaded pictures are named after their content.
#pragma once

#include <string>
#include <string_view>

namespace glasswing {

// The name of the file below images/ with these bytes: "xxh3" and 16 hexadecimal digits.
std::string image_name(std::string_view bytes);
// The same from their checksum, "xxh3:...".
std::string image_name_of(std::string checksum);

}  // namespace glasswing
