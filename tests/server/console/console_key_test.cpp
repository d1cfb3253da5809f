#include "server/console/console_key.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/base/file.h"

namespace glasswing {
namespace {

using std::chrono::hours, std::chrono::seconds, std::chrono::sys_seconds;

class ConsoleKeyTest : public testing::Test {
 protected:
  ConsoleKeyTest() { std::filesystem::create_directories(data_); }
  ~ConsoleKeyTest() override { std::filesystem::remove_all(data_); }

  const std::filesystem::path data_ =
      std::filesystem::temp_directory_path() / ("glasswing-console-key-" + std::to_string(::getpid()));
  const sys_seconds now_{seconds(1'800'000'000)};
};

TEST_F(ConsoleKeyTest, ATokenSaysWhoseItIsUntilItExpires) {
  const ConsoleKey key = ConsoleKey::open(data_).value();
  const std::string token = key.token_of("anna", "viewer", now_ + hours(1), now_).value();
  const Principal principal = key.principal_of(token, now_ + hours(1) - seconds(1)).value();
  EXPECT_EQ(principal.name, "anna");
  EXPECT_EQ(principal.roles, only(Role::kViewer));
  EXPECT_EQ(principal.expires, now_ + hours(1));
  EXPECT_EQ(key.principal_of(token, now_ + hours(1)).status().code(), absl::StatusCode::kUnauthenticated);
  EXPECT_EQ(key.principal_of(key.token_of("o", "operator", now_ + hours(1), now_).value(), now_)->roles,
            only(Role::kOperator));
}

TEST_F(ConsoleKeyTest, NoCharacterOfATokenCanBeAnother) {
  const ConsoleKey key = ConsoleKey::open(data_).value();
  const std::string token = key.token_of("anna", "viewer", now_ + hours(1), now_).value();
  for (size_t at = 0; at < token.size(); ++at) {
    for (const char other : {'A', 'b', '7', '-', '.', ' ', '\0'}) {
      if (token[at] == other) continue;
      std::string altered = token;
      altered[at] = other;
      EXPECT_FALSE(key.principal_of(altered, now_).ok()) << at << " as " << other;
    }
    EXPECT_FALSE(key.principal_of(token.substr(0, at), now_).ok()) << at;
  }
}

TEST_F(ConsoleKeyTest, TheKeyStaysAndAnotherSignsOtherwise) {
  const std::string token =
      ConsoleKey::open(data_)->token_of("anna", "viewer", now_ + hours(1), now_).value();
  EXPECT_TRUE(ConsoleKey::open(data_)->principal_of(token, now_).ok());
  std::filesystem::remove(data_ / "console-key");
  EXPECT_FALSE(ConsoleKey::open(data_)->principal_of(token, now_).ok());
}

TEST_F(ConsoleKeyTest, TheKeyIsForItsOwnerAndWhole) {
  ASSERT_TRUE(ConsoleKey::open(data_).ok());
  struct stat file {};
  ASSERT_EQ(::stat((data_ / "console-key").c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 0777u, 0600u);
  ASSERT_TRUE(write_file_durably(data_ / "console-key", "short").ok());
  EXPECT_EQ(ConsoleKey::open(data_).status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(ConsoleKeyTest, RefusesWhatATokenCannotSay) {
  const ConsoleKey key = ConsoleKey::open(data_).value();
  EXPECT_FALSE(key.token_of("an na", "viewer", now_ + hours(1), now_).ok());
  EXPECT_FALSE(key.token_of("anna", "server", now_ + hours(1), now_).ok());
  EXPECT_FALSE(key.token_of("anna", "viewer", now_, now_).ok());
  EXPECT_FALSE(key.token_of("anna", "viewer", now_ + hours(24 * 366), now_).ok());
}

}  // namespace
}  // namespace glasswing
