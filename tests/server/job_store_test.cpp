#include "server/job_store.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <vector>

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
  ASSERT_TRUE(store_->create("s", std::vector{4, 4, 2}).ok());
  int next_row = 0;
  for (int i = 0; i < 3; ++i) {
    const Tile tile = store_->claim("solver", seconds(1)).value().value();
    EXPECT_EQ(tile.first, next_row);
    next_row += tile.count;
  }
  EXPECT_EQ(next_row, 10);
  EXPECT_FALSE(store_->claim("solver", seconds(1)).value().has_value());
}

TEST_F(Jobs, ALostLeaseIsFenced) {
  ASSERT_TRUE(store_->create("s", std::vector{4}).ok());
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
  ASSERT_TRUE(store_->create("s", std::vector{4, 4}).ok());
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
  ASSERT_TRUE(store_->create("s", std::vector{4}).ok());
  Tile tile;
  for (int i = 1; i <= kMaxAttempts; ++i) {
    tile = store_->claim("a", seconds(1)).value().value();
    EXPECT_EQ(store_->fail(tile).value(), i == kMaxAttempts);
  }
  const Tile old = store_->claim("a", seconds(1)).value().value();
  ASSERT_TRUE(store_->create("s", std::vector{4}).ok());
  EXPECT_TRUE(absl::IsAborted(store_->complete(old, "old.exr")));
}

TEST_F(Jobs, WhatWasGivenUpIsFencedFromALaterSolve) {
  ASSERT_TRUE(store_->create("s", std::vector{4, 4}).ok());
  const Tile held = store_->claim("a", seconds(1)).value().value();
  ASSERT_TRUE(store_->give_up("s").ok());
  EXPECT_TRUE(absl::IsAborted(store_->keep(held, seconds(1))));
  EXPECT_FALSE(store_->claim("b", seconds(100)).value().has_value());
  ASSERT_TRUE(store_->create("s", std::vector{4, 4}).ok());
  const Tile again = store_->claim("b", seconds(100)).value().value();
  EXPECT_EQ(again.number, held.number);
  EXPECT_TRUE(absl::IsAborted(store_->complete(held, "late.exr")));
  EXPECT_TRUE(store_->complete(again, "new.exr").ok());
}

TEST_F(Jobs, AStoreOfBeforeTilesOfFramesOpens) {
  store_ = nullptr;
  {
    fs::remove(directory_ / "jobs.sqlite");
    Database old = Database::open(directory_ / "jobs.sqlite").value();
    ASSERT_TRUE(old.run("CREATE TABLE tiles (id INTEGER PRIMARY KEY AUTOINCREMENT, session TEXT NOT NULL, "
                        "number INTEGER NOT NULL, first_row INTEGER NOT NULL, row_count INTEGER NOT NULL, "
                        "attempt INTEGER NOT NULL DEFAULT 0, failures INTEGER NOT NULL DEFAULT 0, "
                        "lease_until INTEGER NOT NULL DEFAULT 0, solver TEXT NOT NULL DEFAULT '', "
                        "result TEXT NOT NULL DEFAULT '', UNIQUE (session, number)); "
                        "INSERT INTO tiles (session, number, first_row, row_count, attempt, result) VALUES "
                        "('s', 0, 0, 7, 1, '0-1.exr'), ('s', 1, 7, 5, 0, '')")
                    .ok());
  }
  for (int opened = 0; opened < 2; ++opened) {
    open();
    const std::vector<Tile> tiles = store_->tiles("s").value();
    ASSERT_EQ(tiles.size(), 2u);
    EXPECT_EQ(tiles[0].result, "0-1.exr");
    EXPECT_EQ(tiles[1].first, 7);
    EXPECT_EQ(tiles[1].count, 5);
  }
  EXPECT_EQ(store_->claim("a", seconds(1)).value().value().number, 1);
}

TEST_F(Jobs, WhatIsHeldIsNotHandedOutAndMayBeCompleted) {
  ASSERT_TRUE(store_->create("s", std::vector{4, 4}).ok());
  ASSERT_TRUE(store_->create("t", std::vector{4}).ok());
  const Tile under_way = store_->claim("a", seconds(1)).value().value();
  ASSERT_EQ(under_way.session, "s");
  ASSERT_TRUE(store_->hold("s").ok());
  EXPECT_EQ(store_->claim("b", seconds(1)).value().value().session, "t");
  EXPECT_FALSE(store_->claim("b", seconds(1)).value().has_value());
  EXPECT_TRUE(store_->complete(under_way, "0.exr").ok());
  ASSERT_TRUE(store_->release("s").ok());
  EXPECT_EQ(store_->claim("b", seconds(1)).value().value().number, 1);
}

TEST_F(Jobs, FailedTilesAndRefusedFramesAreTriedAgainAlone) {
  ASSERT_TRUE(store_->create("s", std::vector{16, 16}).ok());
  const Tile done = store_->claim("a", seconds(1)).value().value();
  ASSERT_TRUE(store_->complete(done, "attempt").ok());
  for (int i = 0; i < kMaxAttempts; ++i) {
    const Tile failing = store_->claim("a", seconds(1)).value().value();
    EXPECT_EQ(store_->fail(failing).value(), i + 1 == kMaxAttempts);
  }
  ASSERT_TRUE(store_->retry("s").ok());
  ASSERT_TRUE(store_->add("s", std::vector<FrameRange>{{.first = 3, .count = 2}}).ok());
  const Tile again = store_->claim("a", seconds(1)).value().value();
  EXPECT_EQ(again.number, 1);
  EXPECT_FALSE(store_->fail(again).value()) << "it counts as new";
  const Tile added = store_->claim("a", seconds(1)).value().value();
  EXPECT_EQ(added.number, 2);
  EXPECT_EQ(added.first, 3);
  EXPECT_EQ(added.count, 2);
  EXPECT_GT(added.attempt, again.attempt);
  EXPECT_EQ(store_->tiles("s")->at(0).result, "attempt");
}

TEST_F(Jobs, ALaterSessionOfARemovedOnesNameTakesNoneOfItsResults) {
  ASSERT_TRUE(store_->create("s", std::vector{4, 4}).ok());
  const Tile slow = store_->claim("slow", seconds(1)).value().value();
  ASSERT_TRUE(store_->remove("s").ok());
  EXPECT_FALSE(store_->claim("a", seconds(60)).value().has_value());
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow, "slow.exr")));
  ASSERT_TRUE(store_->create("s", std::vector{4, 4}).ok());
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow, "slow.exr")));
  const Tile quick = store_->claim("a", seconds(1)).value().value();
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow, "slow.exr")));
  EXPECT_TRUE(store_->complete(quick, "quick.exr").ok());
}

}  // namespace
}  // namespace glasswing
