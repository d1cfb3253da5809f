// Leases: renewed, expired, fenced, handed out twice, failed.
#include "tests/server/jobs/contract.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

constexpr milliseconds kShort(30);

TEST_P(JobContract, ALostLeaseIsFenced) {
  open(options(kShort));
  create(1);
  const Lease slow = claimed("slow");
  const Lease quick = claim_at_last("quick");
  EXPECT_EQ(quick.id.tile, slow.id.tile);
  EXPECT_GT(quick.id.attempt, slow.id.attempt);
  EXPECT_TRUE(absl::IsAborted(store_->renew(slow.id)));
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow.id, result("slow"))));
  EXPECT_FALSE(store_->fail(slow.id, "late", true).value());
  EXPECT_OK(store_->hand_back(slow.id));
  EXPECT_OK(store_->complete(quick.id, result("quick")));
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow.id, result("slow"))));
  EXPECT_EQ(tile(quick).done.result, "quick");
  EXPECT_EQ(tile(quick).failures, 0);
}

TEST_P(JobContract, ATileThatSilencesItsSolversIsGivenUp) {
  open(options(kShort));
  const std::int64_t job = create(1);
  for (int i = 0; i < kMaxLost; ++i) claim_at_last("victim");
  ASSERT_TRUE(comes_true([&] {
    EXPECT_FALSE(claim("another").has_value());
    return store_->counts(job)->quarantined == 1;
  }));
  EXPECT_EQ(store_->tiles(job)->front().error, "10 solvers that had it fell silent");
  EXPECT_TRUE(store_->counts(job)->rests());
  ASSERT_OK(store_->retry(job));
  EXPECT_TRUE(claim("another").has_value());
}

TEST_P(JobContract, ALeaseThatEndedAndWasNotHandedOutAgainGoesOn) {
  open(options(kShort));
  create(2);
  const Lease kept = claimed("a"), completed = claimed("a");
  ASSERT_TRUE(comes_true([&] { return store_->leases()->empty(); }));
  EXPECT_OK(store_->renew(kept.id));
  EXPECT_OK(store_->complete(completed.id, result("x")));
  EXPECT_OK(store_->complete(kept.id, result("y")));
}

TEST_P(JobContract, AKeptLeaseDoesNotEnd) {
  open(options(kShort));
  create(1);
  const Lease lease = claimed("a");
  open(options());  // lasts, so that the test's pace does not matter
  ASSERT_OK(store_->renew(lease.id));
  EXPECT_EQ(store_->leases()->size(), 1u);
  EXPECT_FALSE(claim("b").has_value());
}

TEST_P(JobContract, ACompletionMayBeSaidAgain) {
  const std::int64_t job = create(2);
  const Lease lease = claimed("a");
  ASSERT_OK(store_->complete(lease.id, result("x")));
  EXPECT_OK(store_->complete(lease.id, result("x")));
  EXPECT_EQ(store_->counts(job)->done, 1);
  EXPECT_EQ(store_->counts(job)->object_pixels, 10);
  // A done tile stays done.
  EXPECT_TRUE(absl::IsAborted(store_->renew(lease.id)));
  EXPECT_FALSE(store_->fail(lease.id, "late", true).value());
  EXPECT_OK(store_->hand_back(lease.id));
  const TileState state = tile(lease);
  EXPECT_EQ(state.done.result, "x");
  EXPECT_EQ(state.done.seconds, 1.0);
  EXPECT_FALSE(state.quarantined);
  EXPECT_TRUE(absl::IsInvalidArgument(store_->complete(claimed("a").id, result(""))));
}

TEST_P(JobContract, NumbersThatWereNeverHandedOutAreVoid) {
  const std::int64_t job = create(1);
  for (const int attempt : {-1, 0, 1}) {  // not claimed yet
    const TileAttempt id{.job = job, .tile = 0, .attempt = attempt};
    EXPECT_TRUE(absl::IsAborted(store_->renew(id)));
    EXPECT_TRUE(absl::IsAborted(store_->complete(id, result("x"))));
    EXPECT_TRUE(absl::IsAborted(store_->recut(id, "", ranges(1))));
    EXPECT_FALSE(store_->fail(id, "error", true).value());
    EXPECT_OK(store_->hand_back(id));
  }
  EXPECT_EQ(store_->counts(job)->failures, 0);
}

TEST_P(JobContract, OfTwoAtOneTileTheFirstResultCounts) {
  open(options(hours(1), milliseconds(0)));
  create(1);
  const Lease slow = claimed("slow");
  EXPECT_FALSE(claim("slow").has_value());  // not twice to the same solver
  const Lease quick = claim_at_last("quick");
  EXPECT_EQ(quick.id.tile, slow.id.tile);
  EXPECT_NE(quick.id.attempt, slow.id.attempt);
  EXPECT_FALSE(claim("third").has_value());
  const std::vector<LeaseState> leases = store_->leases().value();
  ASSERT_EQ(leases.size(), 2u);
  EXPECT_TRUE(leases[0].twice && leases[1].twice);
  EXPECT_EQ(store_->counts(slow.id.job)->leased, 1);
  EXPECT_OK(store_->renew(slow.id));
  EXPECT_OK(store_->renew(quick.id));
  ASSERT_OK(store_->complete(quick.id, result("quick")));
  EXPECT_TRUE(absl::IsAborted(store_->renew(slow.id)));
  EXPECT_TRUE(absl::IsAborted(store_->complete(slow.id, result("slow"))));
  EXPECT_OK(store_->complete(quick.id, result("quick")));
  EXPECT_EQ(tile(quick).done.result, "quick");
  EXPECT_TRUE(store_->leases()->empty());
}

TEST_P(JobContract, TheOneWhoHadItFirstMayBeFirst) {
  open(options(hours(1), milliseconds(0)));
  create(1);
  const Lease first = claimed("a"), second = claim_at_last("b");
  ASSERT_OK(store_->complete(first.id, result("first")));
  EXPECT_TRUE(absl::IsAborted(store_->complete(second.id, result("second"))));
  EXPECT_EQ(tile(first).done.result, "first");
}

TEST_P(JobContract, WhoGivesUpDoesNotHurtTheOther) {
  open(options(hours(1), milliseconds(0)));
  for (const bool first_gives_up : {true, false}) {
    for (const bool fails : {true, false}) {
      create(1);
      const Lease first = claimed("a"), second = claim_at_last("b");
      const Lease& gone = first_gives_up ? first : second;
      const Lease& rest = first_gives_up ? second : first;
      if (fails) {
        EXPECT_FALSE(store_->fail(gone.id, "broken", true).value());  // another solver still works on it
      } else {
        EXPECT_OK(store_->hand_back(gone.id));
      }
      EXPECT_TRUE(absl::IsAborted(store_->renew(gone.id)));
      EXPECT_TRUE(absl::IsAborted(store_->complete(gone.id, result("gone"))));
      EXPECT_OK(store_->renew(rest.id));
      const std::vector<LeaseState> leases = store_->leases().value();
      ASSERT_EQ(leases.size(), 1u);
      EXPECT_EQ(leases[0].id.attempt, rest.id.attempt);
      EXPECT_FALSE(leases[0].twice);
      EXPECT_EQ(tile(rest).failures, fails ? 1 : 0);
      ASSERT_OK(store_->complete(rest.id, result("rest")));
    }
  }
}

TEST_P(JobContract, YoungLeasesAreNotHandedOutTwice) {
  open(options(hours(1), hours(1)));
  create(1);
  claimed("a");
  EXPECT_FALSE(claim("b").has_value());
}

TEST_P(JobContract, LeasesYoungerThanTilesTakeAreNotHandedOutTwice) {
  open(options(hours(1), milliseconds(0)));
  const std::int64_t job = create(3);
  ASSERT_OK(store_->complete(claimed("a").id, result("x", 7200.0)));
  ASSERT_OK(store_->complete(claimed("a").id, result("y", 0.0)));
  const Lease slow = claimed("a");
  EXPECT_FALSE(claim("b").has_value());  // an hour on average
  // Each job has its own average.
  ASSERT_OK(store_->suspend(job));
  const std::int64_t other = create(2, "other");
  ASSERT_OK(store_->complete(claimed("a").id, result("x", 0.001)));
  claimed("a");
  EXPECT_EQ(claim_at_last("b").id.job, other);
  EXPECT_OK(store_->renew(slow.id));
}

TEST_P(JobContract, AheadOnlyWhileThereIsEnoughForAll) {
  open(options(hours(1), milliseconds(0)));
  create(5);
  claimed("a");
  claimed("b");
  EXPECT_TRUE(claim("a", true).has_value());   // three are free, two solvers hold leases
  EXPECT_TRUE(claim("b", true).has_value());   // two are free
  EXPECT_FALSE(claim("a", true).has_value());  // one is
  claimed("c");
  EXPECT_FALSE(claim("c", true).has_value());  // none is, and leased ones are not handed out twice
}

TEST_P(JobContract, AFailedTileIsTriedAgainThenQuarantined) {
  const std::int64_t job = create(2);
  const Lease first = claimed("a");
  EXPECT_FALSE(store_->fail(first.id, "one", false).value());
  EXPECT_FALSE(store_->fail(first.id, "again", false).value());  // void now
  ASSERT_OK(store_->complete(claimed("a").id, result("x")));     // the failed one comes last
  for (int failures = 1; failures < kMaxAttempts; ++failures) {
    const Lease lease = claimed("b");
    EXPECT_EQ(lease.id.tile, first.id.tile);
    EXPECT_EQ(tile(lease).failures, failures);
    EXPECT_EQ(store_->fail(lease.id, "two", false).value(), failures + 1 == kMaxAttempts);
  }
  EXPECT_TRUE(tile(first).quarantined);
  EXPECT_EQ(tile(first).error, "two");
  EXPECT_FALSE(claim("a").has_value());
  EXPECT_TRUE(store_->counts(job)->rests());

  ASSERT_OK(store_->retry(job));
  EXPECT_FALSE(tile(first).quarantined);
  EXPECT_EQ(tile(first).failures, 0);
  EXPECT_OK(store_->complete(claimed("a").id, result("y")));
}

TEST_P(JobContract, APermanentFailureQuarantinesAtOnce) {
  create(1);
  const Lease lease = claimed("a");
  EXPECT_TRUE(store_->fail(lease.id, "no such method", true).value());
  EXPECT_TRUE(tile(lease).quarantined);
  EXPECT_TRUE(absl::IsAborted(store_->complete(lease.id, result("x"))));
}

TEST_P(JobContract, AQuarantinedTileIsDoneByNobody) {
  open(options(hours(1), milliseconds(0)));
  create(1);
  const Lease first = claimed("a");
  open(options(kShort, milliseconds(0)));
  const Lease second = claim_at_last("b");
  ASSERT_TRUE(comes_true([&] { return store_->leases()->size() == 1; }));  // the second lease has expired
  EXPECT_TRUE(store_->fail(first.id, "broken", true).value());
  EXPECT_TRUE(absl::IsAborted(store_->complete(second.id, result("x"))));
  EXPECT_TRUE(store_->counts(first.id.job)->rests());
}

TEST_P(JobContract, HandingBackIsNoFailure) {
  const std::int64_t job = create(1);
  for (int i = 0; i < kMaxAttempts + 1; ++i) {
    const Lease lease = claimed("a");
    ASSERT_OK(store_->hand_back(lease.id));
    EXPECT_OK(store_->hand_back(lease.id));
    EXPECT_TRUE(absl::IsAborted(store_->complete(lease.id, result("x"))));
  }
  EXPECT_EQ(store_->counts(job)->failures, 0);
  EXPECT_EQ(store_->counts(job)->quarantined, 0);
}

// The sessions of the next claims, each done at once.
std::string next_sessions(JobStore& store, int count) {
  const std::vector<std::string> computes{"gaussian/1"};
  std::string sessions;
  for (int i = 0; i < count; ++i) {
    const std::optional<Lease> lease = store.claim("solver", computes, false).value();
    if (!lease) return sessions + "-";
    sessions += lease->session;
    EXPECT_OK(store.complete(lease->id, result("tile")));
  }
  return sessions;
}

TEST_P(JobContract, AHigherClassGoesFirst) {
  const std::int64_t film = create(3, "f"), middle = create(3, "m"), still = create(3, "s");
  EXPECT_OK(store_->set_class(film, JobClass::kBatch));
  EXPECT_OK(store_->set_class(still, JobClass::kInteractive));
  EXPECT_TRUE(absl::IsNotFound(store_->set_class(still + 100, JobClass::kBatch)));
  std::vector<std::string> order;
  const std::vector<JobState> jobs = store_->jobs().value();
  for (const JobState& job : jobs) order.push_back(job.session);
  EXPECT_EQ(order, (std::vector<std::string>{"s", "m", "f"}));
  EXPECT_EQ(next_sessions(*store_, 2), "ss");
  EXPECT_OK(store_->suspend(middle));
  EXPECT_EQ(next_sessions(*store_, 2), "sf");
  EXPECT_OK(store_->resume(middle));
  EXPECT_EQ(next_sessions(*store_, 6), "mmmff-");
}

TEST_P(JobContract, NoClassStarves) {
  JobStoreOptions patient = options();
  patient.class_waits = kShort;
  open(patient);
  const std::int64_t film = create(1, "f");
  create(100'000, "s");
  EXPECT_OK(store_->set_class(film, JobClass::kBatch));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  EXPECT_EQ(next_sessions(*store_, 1), "s");
  while (next_sessions(*store_, 1) != "f") ASSERT_LT(std::chrono::steady_clock::now(), deadline);
  EXPECT_GT(store_->jobs()->size(), 0u);  // it did not wait for the other's end
}

// Tiles take a second each of the one solver (result()).
TEST_P(JobContract, ADeadlineGetsTheShareThatItNeeds) {
  const auto in = [](double seconds) { return absl::Now() + absl::Seconds(seconds); };
  const std::int64_t still = create(100, "s"), film = create(100, "f"), other = create(100, "o");
  EXPECT_OK(store_->set_class(still, JobClass::kInteractive));
  EXPECT_OK(store_->set_class(film, JobClass::kBatch));
  EXPECT_TRUE(absl::IsNotFound(store_->set_deadline(other + 100, in(10))));
  EXPECT_OK(store_->set_deadline(film, in(1000)));  // time enough for 100 tiles
  EXPECT_EQ(next_sessions(*store_, 2), "ss");
  EXPECT_OK(store_->set_deadline(film, in(100)));
  EXPECT_EQ(next_sessions(*store_, 2), "ff");
  EXPECT_OK(store_->set_deadline(other, in(50)));  // the earlier one first
  EXPECT_EQ(next_sessions(*store_, 2), "oo");
  const std::vector<JobState> jobs = store_->jobs().value();
  for (const JobState& job : jobs)
    EXPECT_EQ(job.deadline == absl::InfiniteFuture(), job.session == "s") << job.session;
  EXPECT_OK(store_->set_deadline(other, absl::InfiniteFuture()));
  EXPECT_OK(store_->set_deadline(film, in(1000)));
  EXPECT_EQ(next_sessions(*store_, 2), "ss");
}

TEST_P(JobContract, NothingStarvesBesideADeadline) {
  JobStoreOptions patient = options();
  patient.class_waits = kShort;
  open(patient);
  const std::int64_t late = create(100'000, "l");
  create(1, "n");
  EXPECT_OK(store_->set_deadline(late, absl::Now() - absl::Hours(1)));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  EXPECT_EQ(next_sessions(*store_, 1), "l");
  while (next_sessions(*store_, 1) != "n") ASSERT_LT(std::chrono::steady_clock::now(), deadline);
}

TEST_P(JobContract, OwnersTakeTurns) {
  const auto create_of = [&](const std::string& owner, const std::string& session) {
    const std::vector<TileRange> four(4, TileRange{0, 4});
    return store_->create({.session = session, .owner = owner, .computes = "gaussian/1", .work = "w"}, four)
        .value();
  };
  create_of("anna", "a");
  create_of("anna", "b");
  create_of("bob", "c");
  // Anna's older solve first; Bob, who came last, has every second tile.
  EXPECT_EQ(next_sessions(*store_, 12), "acacacacbbbb");
}

}  // namespace
}  // namespace glasswing
