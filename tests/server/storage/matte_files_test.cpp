#include "server/storage/matte_files.h"

#include <gtest/gtest.h>

#include "core/file/file.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class MatteFilesTest : public testing::Test {
 protected:
  MatteFilesTest() {
    fs::create_directories(data_ / "mattes");
    fs::create_directories(data_ / "tiles");
  }
  void write(const fs::path& path, const std::string& bytes) { ASSERT_OK(write_file_durably(path, bytes)); }
  void write_next_frames(const std::string& session, const std::string& bytes) {
    ASSERT_OK(files_.make_next(session));
    for (int frame = 0; frame < 3; ++frame) write(files_.next(session, frame), bytes);
  }

  const TemporaryDirectory data_;
  const MatteFiles files_{data_};
};

TEST_F(MatteFilesTest, WhatIsFinishedTakesThePlaceOfWhatWasBefore) {
  write(files_.next("s"), "first");
  ASSERT_OK(files_.finish("s"));
  EXPECT_EQ(read_file(files_.finished("s")).value(), "first");
  // Frames in place of a still, frames in place of frames, and a still again.
  for (const char* frames : {"second", "third"}) {
    write_next_frames("s", frames);
    EXPECT_NE(read_file(files_.finished("s", 2)).value_or(""), frames);
    ASSERT_OK(files_.finish("s"));
    EXPECT_EQ(read_file(files_.finished("s", 2)).value(), frames);
    EXPECT_FALSE(fs::exists(files_.finished("s")));
  }
  write(files_.next("s"), "fourth");
  ASSERT_OK(files_.tiles("s"));
  ASSERT_OK(files_.finish("s"));
  ASSERT_OK(files_.finish("s")) << "nothing is left to do";
  EXPECT_EQ(read_file(files_.finished("s")).value(), "fourth");
  EXPECT_FALSE(fs::exists(files_.finished("s", 2).parent_path()));
  EXPECT_TRUE(fs::is_empty(data_ / "tiles"));
}

TEST_F(MatteFilesTest, ASolveGivenUpLeavesWhatWasFinished) {
  write(files_.finished("s"), "finished");
  write(files_.next("s"), "next");
  write_next_frames("s", "next");
  write(files_.tiles("s").value() / "0-1.exr", "tile");
  ASSERT_OK(files_.drop_next("s"));
  EXPECT_EQ(read_file(files_.finished("s")).value(), "finished");
  EXPECT_FALSE(fs::exists(files_.next("s")));
  EXPECT_FALSE(fs::exists(files_.next("s", 0)));
  EXPECT_TRUE(fs::is_empty(data_ / "tiles"));
}

TEST_F(MatteFilesTest, ADraftStaysUntilASolveFinishesOrTheSessionGoes) {
  write(files_.draft("a"), "draft of a");
  write(files_.draft("b.c"), "draft");
  write(files_.next("a"), "next");
  ASSERT_OK(files_.drop_next("a"));
  const auto drafts = files_.drafts();
  ASSERT_EQ(drafts.size(), 2u);
  EXPECT_EQ(drafts.at("a"), files_.draft("a"));
  EXPECT_EQ(read_file(drafts.at("b.c")).value(), "draft");
  write(files_.next("a"), "next");
  ASSERT_OK(files_.finish("a"));
  EXPECT_FALSE(fs::exists(files_.draft("a")));
  EXPECT_EQ(files_.remove("b.c").value(), 5);
  EXPECT_TRUE(files_.drafts().empty());
}

TEST_F(MatteFilesTest, RemovingASessionLeavesThoseWhoseNamesLookAlike) {
  write(files_.finished("a"), "12345");
  write_next_frames("a", "123");
  write(files_.tiles("a").value() / "0-1.exr", "1");
  write(files_.finished("a.exr"), "still of a.exr");  // whose frames would lie where the matte of "a" does
  write(files_.finished("ab"), "still of ab");
  EXPECT_EQ(files_.remove("a.exr").value(), 14);
  EXPECT_EQ(read_file(files_.finished("a")).value(), "12345");
  EXPECT_EQ(files_.remove("a").value(), 5 + 3 * 3 + 1);
  EXPECT_EQ(files_.remove("a").value(), 0) << "asked again, nothing is left";
  EXPECT_EQ(read_file(files_.finished("ab")).value(), "still of ab");
  EXPECT_FALSE(fs::exists(files_.finished("a")));
}

}  // namespace
}  // namespace glasswing
