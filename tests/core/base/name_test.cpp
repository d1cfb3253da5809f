#include "core/base/name.h"

#include <gtest/gtest.h>

#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST(Name, IsASmallSetOfCharacters) {
  for (const char* good : {"a", "7", "vase-1.2_b", "Vase"}) EXPECT_OK(check_name("session", good));
  EXPECT_OK(check_name("session", std::string(64, 'x')));
  for (const char* bad : {"", ".", "-a", "_", "a/b", "..", "a b", "a\n"})
    EXPECT_TRUE(absl::IsInvalidArgument(check_name("session", bad))) << bad;
  EXPECT_TRUE(absl::IsInvalidArgument(check_name("session", std::string(65, 'x'))));
}

TEST(Name, OthersGetASpelling) {
  const auto suggested = [](const std::string& name) {
    const std::string text(check_name("tag", name).message());
    const size_t end = text.rfind("\", say"),
                 begin = end == std::string::npos ? end : text.rfind(": \"", end);
    return end == std::string::npos ? "" : text.substr(begin + 3, end - begin - 3);
  };
  EXPECT_EQ(suggested("große Vase"), "grosse_Vase");
  EXPECT_EQ(suggested("Glaskörper – zweiter Tag!"), "Glaskoerper_zweiter_Tag");
  EXPECT_EQ(suggested("O\u0308l"), "Oel");  // decomposed, as macOS writes names of files
  EXPECT_EQ(suggested(" 1/2 carafe à décanter"), "1_2_carafe_a_decanter");
  EXPECT_EQ(suggested("..vase"), "vase");
  EXPECT_EQ(suggested(std::string(70, 'x')), std::string(64, 'x'));
  EXPECT_EQ(suggested("花瓶"), "");
  // What is suggested is good.
  for (int byte = 1; byte < 256; ++byte) {
    const std::string name = suggested(std::string("\xC3") + static_cast<char>(byte) + "x y");
    EXPECT_OK(check_name("tag", name)) << byte;
  }
}

}  // namespace
}  // namespace glasswing
