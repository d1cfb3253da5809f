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

}  // namespace
}  // namespace glasswing
