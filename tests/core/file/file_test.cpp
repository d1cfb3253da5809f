#include "core/file/file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>

#include "core/base/checksum.h"
#include "core/base/name.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class File : public testing::Test {
 protected:
  const TemporaryDirectory directory_;
};

TEST_F(File, WrittenFilesAreWholeAndLeaveNothingElse) {
  const std::string bytes("\0\n\xff glass", 9);
  ASSERT_OK(write_file_durably(directory_ / "a", bytes));
  ASSERT_OK(append_file_durably(directory_ / "a", "wing"));
  EXPECT_EQ(read_file(directory_ / "a").value(), bytes + "wing");
  EXPECT_EQ(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()), 1);
}

TEST_F(File, FailuresNameThePath) {
  EXPECT_TRUE(absl::IsNotFound(read_file(directory_ / "missing").status()));
  EXPECT_FALSE(read_file(directory_).ok());
  const absl::Status status = write_file_durably(directory_ / "no" / "a", "x");
  EXPECT_NE(std::string(status.message()).find("no/a"), std::string::npos) << status;
}

TEST_F(File, AFifoIsRefusedAtOnce) {
  const fs::path fifo = directory_ / "fifo";
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  const absl::Status status = read_file(fifo).status();  // would wait for a writer for ever
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_NE(status.message().find(fifo.string()), std::string::npos) << status;
  EXPECT_EQ(read_file("/dev/null").value(), "");
}

TEST_F(File, DirectoriesAreMadeWithThoseAboveThem) {
  ASSERT_OK(make_directory_durably(directory_ / "a" / "b"));
  EXPECT_OK(make_directory_durably(directory_ / "a" / "b" / "")) << "it exists already";
  EXPECT_TRUE(fs::is_directory(directory_ / "a" / "b"));
  ASSERT_OK(write_file_durably(directory_ / "file", ""));
  EXPECT_FALSE(make_directory_durably(directory_ / "file" / "c").ok());
}

TEST_F(File, AnAppendThatFailsLeavesTheFileAsLongAsItWas) {
  const fs::path path = directory_ / "journal";
  ASSERT_OK(append_file_durably(path, "line 1\n"));
  // The disk is full after some more bytes.
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  ::signal(SIGXFSZ, SIG_IGN);
  const rlimit few{.rlim_cur = 10, .rlim_max = before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &few), 0);
  const absl::Status status = append_file_durably(path, "line 2\n");
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(read_file(path).value(), "line 1\n");
}

TEST_F(File, AFullDiskIsResourceExhaustedAndKeepsTheOldFile) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  EXPECT_TRUE(absl::IsResourceExhausted(append_file_durably("/dev/full", "x")));
}

TEST(Checksum, SeesEveryBit) {
  std::string bytes(64, 'g');
  const std::string before = checksum_of(bytes);
  for (size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
    EXPECT_NE(checksum_of(bytes), before) << bit;
    bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << (bit % 8)));
  }
}

TEST(Name, RefusesWhatAPathCouldBe) {
  for (const char* name : {"a", "crystal-2", "S.1_x", "7"}) EXPECT_OK(check_name("session", name)) << name;
  for (const std::string& name : {std::string(), std::string(".."), std::string("a/b"), std::string(".a"),
                                  std::string("a b"), std::string(65, 'x'), std::string("\xc3\xa9")}) {
    EXPECT_TRUE(absl::IsInvalidArgument(check_name("session", name))) << name;
  }
}

}  // namespace
}  // namespace glasswing
