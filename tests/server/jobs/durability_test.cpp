// A store that is opened again.
#include "tests/server/jobs/contract.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST_P(JobContract, AStoreOpenedAgainKeepsAll) {
  const std::int64_t job = create(5);
  const Lease done = claimed("a"), leased = claimed("a"), failed = claimed("a"), quarantined = claimed("a");
  ASSERT_OK(store_->complete(done.id, result("done.exr", 2.5)));
  ASSERT_FALSE(store_->fail(failed.id, "dark", false).value());
  ASSERT_TRUE(store_->fail(quarantined.id, "no", true).value());
  open(options());
  EXPECT_EQ(store_->own_jobs().value(), std::vector{job});
  EXPECT_EQ(tile(done).done.result, "done.exr");
  EXPECT_EQ(tile(done).done.seconds, 2.5);
  EXPECT_EQ(tile(failed).failures, 1);
  EXPECT_EQ(tile(failed).error, "dark");
  EXPECT_TRUE(tile(quarantined).quarantined);
  // Leases go on, and completions may be repeated.
  EXPECT_EQ(store_->leases()->size(), 1u);
  EXPECT_OK(store_->renew(leased.id));
  EXPECT_OK(store_->complete(leased.id, result("leased.exr")));
  EXPECT_OK(store_->complete(done.id, result("done.exr")));
  EXPECT_EQ(claimed("a").id.tile, 4);
  EXPECT_GT(create(1), job);
}

TEST_P(JobContract, ASurveyMayBeSaidAgainToAStoreOpenedAgain) {
  const std::int64_t job = create(1);
  const Lease survey = claimed("a");
  ASSERT_OK(store_->recut(survey.id, "plan", ranges(3)));
  open(options());
  ASSERT_OK(store_->recut(survey.id, "plan", ranges(3)));
  EXPECT_EQ(store_->counts(job)->tiles, 3);
}

TEST_P(JobContract, HoldsEndWhenTheServerOpensTheStoreAgain) {
  const std::int64_t job = create(1);
  ASSERT_OK(store_->suspend(job));
  open(options());
  EXPECT_EQ(claimed("a").id.job, job);
}

TEST_P(JobContract, AServerMayMove) {
  create(2);
  claimed("a");
  JobStoreOptions moved = options();
  moved.server_address = "elsewhere.lab:7000";
  open(moved);
  const Lease lease = claimed("a");
  EXPECT_EQ(lease.server_address, "elsewhere.lab:7000");
  EXPECT_TRUE(lease.own);
}

}  // namespace
}  // namespace glasswing
