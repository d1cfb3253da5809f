#include "core/base/utf8.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

namespace glasswing {
namespace {

// RFC 3629, section 3.
std::string encoded(std::uint32_t code) {
  const auto low = [code](int shift) { return static_cast<char>(0x80 | (code >> shift & 0x3f)); };
  if (code < 0x80) return {static_cast<char>(code)};
  if (code < 0x800) return {static_cast<char>(0xc0 | code >> 6), low(0)};
  if (code < 0x10000) return {static_cast<char>(0xe0 | code >> 12), low(6), low(0)};
  return {static_cast<char>(0xf0 | code >> 18), low(12), low(6), low(0)};
}

TEST(Utf8, EveryCharacterIsAndNothingCutOffIt) {
  for (std::uint32_t code = 0; code <= 0x110000; ++code) {
    const std::string text = encoded(code);
    const bool surrogate = code >= 0xd800 && code < 0xe000;
    ASSERT_EQ(is_utf8(text), !surrogate && code <= 0x10ffff) << code;
    for (size_t size = 1; size < text.size(); ++size) ASSERT_FALSE(is_utf8(text.substr(0, size))) << code;
    for (size_t at = 1; at < text.size(); ++at) ASSERT_FALSE(is_utf8(text.substr(at))) << code;
  }
}

TEST(Utf8, WordsAreAndBytesAreNot) {
  EXPECT_TRUE(is_utf8(""));
  EXPECT_TRUE(is_utf8("a gläserner Krug, 玻璃, \xf0\x9f\xa5\x83"));
  EXPECT_FALSE(is_utf8("a\xff"));
  EXPECT_FALSE(is_utf8("\xc0\xaf"));          // overlong
  EXPECT_FALSE(is_utf8("\xe0\x80\xaf"));      // overlong
  EXPECT_FALSE(is_utf8("\xf0\x80\x80\xaf"));  // overlong
  EXPECT_FALSE(is_utf8("\xf8\x88\x80\x80\x80"));
}

TEST(Printable, MovesNoCursorAndStaysOnItsLine) {
  EXPECT_EQ(printable("a gläserner Krug, 玻璃, \xf0\x9f\xa5\x83 \\ \"x\""),
            "a gläserner Krug, 玻璃, \xf0\x9f\xa5\x83 \\ \"x\"");
  EXPECT_EQ(printable("one\ntwo\tthree\r"), "one\\ntwo\\tthree\\x0d");
  EXPECT_EQ(printable("\x1b[2Jgone\x7f"), "\\x1b[2Jgone\\x7f");
  EXPECT_EQ(printable(std::string("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(printable("\u009b2J"), R"(\xc2\x9b2J)");      // CSI as one character
  EXPECT_EQ(printable("a\u2028b"), R"(a\xe2\x80\xa8b)");  // line separator
  EXPECT_EQ(printable("a\u202eb"), R"(a\xe2\x80\xaeb)");  // right to left
  EXPECT_EQ(printable("a\xff\xc3"), "a\\xff\\xc3");
}

TEST(Printable, OfEveryCharacterNoneIsLeftThatATerminalObeys) {
  for (std::uint32_t code = 0; code <= 0x10ffff; ++code) {
    const std::string shown = printable(encoded(code));
    ASSERT_TRUE(is_utf8(shown)) << code;
    const bool obeyed = code < 0x20 || (code >= 0x7f && code < 0xa0);
    ASSERT_TRUE(!obeyed || shown[0] == '\\') << code;
    for (const char byte : shown) ASSERT_FALSE((byte >= 0 && byte < 0x20) || byte == 0x7f) << code;
  }
}

}  // namespace
}  // namespace glasswing
