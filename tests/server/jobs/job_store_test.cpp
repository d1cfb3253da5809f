// Jobs: created, cut again, extended, suspended, retried, removed, reported.
#include "server/jobs/job_store.h"

#include "tests/server/jobs/contract.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

TEST_P(JobContract, TilesAreHandedOutInOrderAndOnce) {
  const std::int64_t job = create(3);
  for (int i = 0; i < 3; ++i) {
    const Lease lease = claimed("solver");
    EXPECT_EQ(lease.id.job, job);
    EXPECT_EQ(lease.id.tile, i);
    EXPECT_EQ(lease.range.first, 4 * i);
    EXPECT_EQ(lease.range.count, 4);
    EXPECT_EQ(lease.session, "session");
    EXPECT_EQ(lease.work, "work");
    EXPECT_EQ(lease.server_address, "a.lab:7000");
    EXPECT_TRUE(lease.own);
  }
  EXPECT_FALSE(claim("solver").has_value());
}

TEST_P(JobContract, TheOldestJobComesFirst) {
  const std::int64_t first = create(1), second = create(1, "other");
  EXPECT_GT(second, first);
  EXPECT_EQ(claimed("a").id.job, first);
  EXPECT_EQ(claimed("a").id.job, second);
  EXPECT_EQ(store_->own_jobs().value(), (std::vector{first, second}));
}

TEST_P(JobContract, NumbersOfRemovedJobsAreNotUsedAgain) {
  const std::int64_t job = create(1);
  ASSERT_OK(store_->remove(job));
  EXPECT_GT(create(1), job);
}

TEST_P(JobContract, OnlyWhoComputesItGetsATile) {
  ASSERT_OK(store_->create({.session = "s", .computes = "gaussian/2", .work = ""}, ranges(1)));
  EXPECT_FALSE(claim("old").has_value());
  EXPECT_FALSE(store_->claim("none", {}, false).value().has_value());
  const std::vector<std::string> computes{"gaussian/2"};
  EXPECT_TRUE(store_->claim("new", computes, false).value().has_value());
}

TEST_P(JobContract, WorkAndResultsAreAnyBytes) {
  const std::string bytes("\0\xff'\\x\n", 6);
  ASSERT_OK(store_->create({.session = "s", .computes = "gaussian/1", .work = bytes}, ranges(2)));
  const Lease lease = claimed("a"), other = claimed("a");
  EXPECT_EQ(lease.work, bytes);
  ASSERT_OK(store_->complete(lease.id, result(bytes)));
  EXPECT_EQ(tile(lease).done.result, bytes);
  ASSERT_OK(store_->fail(other.id, bytes, false));
  EXPECT_EQ(tile(other).error, bytes);
}

TEST_P(JobContract, ASurveyCutsTheJobAnew) {
  const std::int64_t job = create(1);
  const Lease survey = claimed("a");
  ASSERT_OK(store_->recut(survey.id, "plan", ranges(2)));
  ASSERT_EQ(store_->tiles(job)->size(), 2u);
  const Lease first = claimed("a");
  EXPECT_EQ(first.id.tile, 0);
  EXPECT_EQ(first.work, "plan");
  EXPECT_GT(first.id.attempt, survey.id.attempt);  // so that the survey's attempt never names it
  EXPECT_TRUE(absl::IsAborted(store_->renew(survey.id)));
  EXPECT_TRUE(absl::IsAborted(store_->complete(survey.id, result("x"))));
  ASSERT_OK(store_->complete(first.id, result("0.exr")));

  // Repeated, as after a lost answer, it changes nothing.
  ASSERT_OK(store_->recut(survey.id, "other", ranges(5)));
  EXPECT_EQ(store_->counts(job)->tiles, 2);
  EXPECT_EQ(store_->counts(job)->done, 1);
  EXPECT_EQ(claimed("a").work, "plan");
}

TEST_P(JobContract, OfTwoSurveysTheFirstCounts) {
  open(options(std::chrono::hours(1), milliseconds(0)));
  const std::int64_t job = create(1);
  const Lease first = claimed("a"), second = claim_at_last("b");
  ASSERT_EQ(second.id.tile, first.id.tile);
  ASSERT_OK(store_->recut(second.id, "second", ranges(3)));
  EXPECT_TRUE(absl::IsAborted(store_->recut(first.id, "first", ranges(7))));
  EXPECT_EQ(store_->counts(job)->tiles, 3);
  EXPECT_TRUE(absl::IsAborted(store_->recut({.job = job + 1, .tile = 0, .attempt = 1}, "", ranges(1))));
}

TEST_P(JobContract, AddedTilesAreNumberedOn) {
  const std::int64_t job = create(2);
  ASSERT_OK(store_->add(job, std::vector<TileRange>{{.first = 3, .count = 2}}));
  const std::vector<TileState> tiles = store_->tiles(job).value();
  ASSERT_EQ(tiles.size(), 3u);
  EXPECT_EQ(tiles[2].number, 2);
  EXPECT_EQ(tiles[2].range.first, 3);
  EXPECT_EQ(tiles[2].range.count, 2);
}

TEST_P(JobContract, NothingOfAHeldJobIsHandedOut) {
  const std::int64_t job = create(3);
  const Lease before = claimed("a"), other = claimed("a");
  ASSERT_OK(store_->suspend(job));
  ASSERT_OK(store_->suspend(job));
  EXPECT_FALSE(claim("b").has_value());
  EXPECT_TRUE(store_->jobs()->at(0).suspended);
  EXPECT_OK(store_->renew(before.id));
  EXPECT_OK(store_->complete(before.id, result("x")));
  EXPECT_OK(store_->hand_back(other.id));
  EXPECT_FALSE(claim("b").has_value());
  ASSERT_OK(store_->resume(job));
  EXPECT_EQ(claimed("b").id.tile, other.id.tile);
}

TEST_P(JobContract, WhatIsAskedOfNoJobIsNotFound) {
  for (const absl::Status& status :
       {store_->add(7, ranges(1)), store_->suspend(7), store_->resume(7), store_->retry(7)}) {
    EXPECT_TRUE(absl::IsNotFound(status)) << status;
  }
  EXPECT_OK(store_->remove(7));
  EXPECT_TRUE(store_->tiles(7)->empty());
  EXPECT_EQ(store_->counts(7)->tiles, 0);
  EXPECT_TRUE(absl::IsAborted(store_->tile({.job = 7, .tile = 0, .attempt = 1}).status()));
}

TEST_P(JobContract, ARemovedJobFencesWhoWorksOnIt) {
  const std::int64_t job = create(2);
  const Lease lease = claimed("a");
  ASSERT_OK(store_->remove(job));
  EXPECT_FALSE(claim("b").has_value());
  EXPECT_TRUE(absl::IsAborted(store_->renew(lease.id)));
  EXPECT_TRUE(absl::IsAborted(store_->complete(lease.id, result("x"))));
  EXPECT_FALSE(store_->fail(lease.id, "error", true).value());
  EXPECT_OK(store_->hand_back(lease.id));
  EXPECT_TRUE(store_->own_jobs()->empty());
  EXPECT_TRUE(store_->leases()->empty());
}

TEST_P(JobContract, CountsTellWhatRests) {
  const std::int64_t job = create(4);
  const Lease done = claimed("a"), failed = claimed("a"), leased = claimed("b");
  ASSERT_OK(store_->complete(done.id, result("x")));
  ASSERT_TRUE(store_->fail(failed.id, "no light", true).value());
  JobCounts counts = store_->counts(job).value();
  EXPECT_EQ(counts.tiles, 4);
  EXPECT_EQ(counts.done, 1);
  EXPECT_EQ(counts.quarantined, 1);
  EXPECT_EQ(counts.leased, 1);
  EXPECT_EQ(counts.failures, 1);
  EXPECT_EQ(counts.object_pixels, 10);
  EXPECT_EQ(counts.flagged_pixels, 3);
  EXPECT_EQ(counts.unsolved_pixels, 2);
  EXPECT_FALSE(counts.rests());

  const std::vector<LeaseState> leases = store_->leases().value();
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_EQ(leases[0].id.tile, leased.id.tile);
  EXPECT_EQ(leases[0].solver, "b");
  EXPECT_EQ(leases[0].session, "session");
  EXPECT_FALSE(leases[0].twice);
  EXPECT_GE(leases[0].seconds, 0.0);

  const std::vector<JobState> jobs = store_->jobs().value();
  ASSERT_EQ(jobs.size(), 1u);
  EXPECT_EQ(jobs[0].id, job);
  EXPECT_EQ(jobs[0].session, "session");
  EXPECT_EQ(jobs[0].computes, "gaussian/1");
  EXPECT_EQ(jobs[0].server_address, "a.lab:7000");
  EXPECT_EQ(jobs[0].counts.done, 1);
  EXPECT_GT(jobs[0].tiles_per_second, 0.0);

  ASSERT_OK(store_->complete(leased.id, result("y")));
  ASSERT_OK(store_->complete(claimed("a").id, result("z")));
  counts = store_->counts(job).value();
  EXPECT_TRUE(counts.rests());
  EXPECT_EQ(counts.object_pixels, 30);
  EXPECT_TRUE(store_->jobs()->empty());
}

TEST_P(JobContract, AHintWakesWhoWaits) {
  store_->wait_for_tiles(milliseconds(0));
  const auto before = std::chrono::steady_clock::now();
  create(1);
  store_->wait_for_tiles(std::chrono::minutes(1));  // at once
  const Lease lease = claimed("a");
  ASSERT_OK(store_->hand_back(lease.id));
  store_->wait_for_tiles(std::chrono::minutes(1));
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::minutes(1));
}

}  // namespace
}  // namespace glasswing
