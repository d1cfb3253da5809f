#include "core/file/directory_lock.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/support/status.h"

namespace glasswing {
namespace {

std::filesystem::path fresh_directory() {
  std::string name = testing::TempDir() + "lock-XXXXXX";
  return ::mkdtemp(name.data());
}

TEST(DirectoryLock, OneHasTheDirectoryUntilItLetsGo) {
  const std::filesystem::path directory = fresh_directory() / "made" / "by it";
  EXPECT_FALSE(DirectoryLock::is_taken(directory));
  {
    const absl::StatusOr<DirectoryLock> first = DirectoryLock::take(directory);
    ASSERT_OK(first);
    EXPECT_TRUE(DirectoryLock::is_taken(directory));
    const absl::Status second = DirectoryLock::take(directory).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(second)) << second;
    EXPECT_NE(second.message().find(directory.string()), std::string::npos) << second;
    EXPECT_NE(second.message().find(std::to_string(::getpid())), std::string::npos) << second;
  }
  EXPECT_FALSE(DirectoryLock::is_taken(directory));
  EXPECT_OK(DirectoryLock::take(directory));
}

TEST(DirectoryLock, AProcessThatIsKilledLetsGo) {
  const std::filesystem::path directory = fresh_directory();
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const absl::StatusOr<DirectoryLock> lock = DirectoryLock::take(directory);
    (void)!::write(ready[1], lock.ok() ? "y" : "n", 1);
    while (true) ::pause();
  }
  char taken = 0;
  ASSERT_EQ(::read(ready[0], &taken, 1), 1);
  EXPECT_EQ(taken, 'y');
  EXPECT_TRUE(DirectoryLock::is_taken(directory));
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_OK(DirectoryLock::take(directory));
}

}  // namespace
}  // namespace glasswing
