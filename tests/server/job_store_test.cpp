#include "server/job_store.h"

#include <gtest/gtest.h>
#include <unistd.h>

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

class Jobs : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(directory_);
    fs::create_directories(directory_);
    open();
  }
  void TearDown() override { fs::remove_all(directory_); }
  void open() {
    store_ = nullptr;
    store_ = JobStore::open(directory_ / "jobs.sqlite").value();
  }
  const fs::path directory_ = fs::path(testing::TempDir()) / ("job_store_test." + std::to_string(::getpid()));
  std::unique_ptr<JobStore> store_;
};

TEST_F(Jobs, TilesCoverEveryRowOnce) {
  ASSERT_TRUE(store_->create("s", 10, 4).ok());
  int next_row = 0;
  for (int i = 0; i < 3; ++i) {
    const Tile tile = store_->claim("solver", seconds(1)).value().value();
    EXPECT_EQ(tile.first_row, next_row);
    next_row += tile.row_count;
  }
  EXPECT_EQ(next_row, 10);
  EXPECT_FALSE(store_->claim("solver", seconds(1)).value().has_value());
}

TEST_F(Jobs, ALostLeaseIsFenced) {
  ASSERT_TRUE(store_->create("s", 4, 4).ok());
  const Tile slow = store_->claim("slow", seconds(1)).value().value();
  EXPECT_FALSE(store_->claim("quick", seconds(1) + kLease).value().has_value());  // still held
  ASSERT_TRUE(store_->keep(slow, seconds(5)).ok());
  EXPECT_FALSE(store_->claim("quick", seconds(5) + kLease).value().has_value());  // kept
  const Tile quick = store_->claim("quick", seconds(6) + kLease).value().value();
  EXPECT_GT(quick.attempt, slow.attempt);
  EXPECT_TRUE(absl::IsAborted(store_->keep(slow, seconds(20))));
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow, "slow.exr")));
  EXPECT_TRUE(store_->complete(quick, "quick.exr").ok());
  EXPECT_TRUE(store_->complete(quick, "quick.exr").ok());  // an answer lost on the way is asked for again
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow, "slow.exr")));
  EXPECT_EQ(store_->tiles("s").value()[0].result, "quick.exr");
}

TEST_F(Jobs, DoneTilesOutliveTheServerAndLeasesDoNot) {
  ASSERT_TRUE(store_->create("s", 8, 4).ok());
  const Tile done = store_->claim("a", seconds(1)).value().value();
  const Tile held = store_->claim("a", seconds(1)).value().value();
  ASSERT_TRUE(store_->complete(done, "done.exr").ok());
  open();
  const Tile again = store_->claim("b", seconds(1)).value().value();
  EXPECT_EQ(again.number, held.number);
  EXPECT_TRUE(absl::IsAborted(store_->complete(held, "late.exr")));
  EXPECT_FALSE(store_->claim("b", seconds(1)).value().has_value());
}

TEST_F(Jobs, AttemptsAreCountedAndANewSolveFencesTheOld) {
  ASSERT_TRUE(store_->create("s", 4, 4).ok());
  Tile tile;
  for (int i = 1; i <= kMaxAttempts; ++i) {
    tile = store_->claim("a", seconds(1)).value().value();
    EXPECT_EQ(store_->fail(tile).value(), i == kMaxAttempts);
  }
  const Tile old = store_->claim("a", seconds(1)).value().value();
  ASSERT_TRUE(store_->create("s", 4, 4).ok());
  EXPECT_TRUE(absl::IsAborted(store_->complete(old, "old.exr")));
}

}  // namespace
}  // namespace glasswing
