// UTF-8 (RFC 3629), the encoding of all text in messages and files.
#pragma once

#include <string_view>

namespace glasswing {

// Rejects stray bytes, overlong encodings, surrogates and code points above U+10FFFF.
bool is_utf8(std::string_view text);

}  // namespace glasswing
