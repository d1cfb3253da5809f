// UTF-8 (RFC 3629), the encoding of all text in messages and files.
#pragma once

#include <string>
#include <string_view>

namespace glasswing {

// Rejects stray bytes, overlong encodings, surrogates and code points above U+10FFFF.
bool is_utf8(std::string_view text);

// The text on one line, without cursor movement: control characters (C0, DEL, C1), the separators of lines
// and paragraphs (U+2028, U+2029), what turns the direction of writing (U+202A to U+202E, U+2066 to U+2069)
// and bytes that are not UTF-8 become "\n", "\t" or "\x1b", byte by byte. For logs and terminals.
std::string printable(std::string_view text);

}  // namespace glasswing
