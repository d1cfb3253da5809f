// Text that may be put into messages and files: UTF-8 (RFC 3629).
#pragma once

#include <string_view>

namespace glasswing {

// No byte is astray, no character longer than need be, none a surrogate or beyond U+10FFFF.
bool is_utf8(std::string_view text);

}  // namespace glasswing
