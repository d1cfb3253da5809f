// PostgreSQL alone: several servers share it, and it may be away for a while.
#include "server/jobs/postgres_job_store.h"

#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <thread>

#include "tests/server/jobs/helpers.h"
#include "tests/server/jobs/postgres_fixture.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

const std::vector<std::string> kComputes{"gaussian/1"};

absl::Status refusal(const std::string& connection) {
  JobStoreOptions options;
  options.server_id = "refused";
  Problems problems;
  const auto store = open_job_store(connection, "", options, problems);
  return store.ok() ? (*store)->own_jobs().status() : store.status();
}

class SharedJobs : public testing::Test {
 protected:
  void SetUp() override {
    if (postgres_ == nullptr) GTEST_SKIP() << PostgresFixture::kMissing;
    postgres_->clear();
  }
  std::unique_ptr<JobStore> open(const std::string& id, milliseconds twice = hours(1),
                                 milliseconds lease = hours(1)) {
    return open_job_store(postgres_->connection(), "",
                          {.server_id = id,
                           .server_address = id + ".lab:7000",
                           .lease = lease,
                           .least_before_twice = twice},
                          problems_)
        .value();
  }
  static std::int64_t create(JobStore& store, int tiles) {
    return store.create({.session = "session", .computes = "gaussian/1", .work = ""}, ranges(tiles)).value();
  }
  static std::optional<Lease> claim(JobStore& store, const std::string& solver) {
    return store.claim(solver, kComputes, false).value();
  }
  const PostgresFixture* const postgres_ = PostgresFixture::shared();
  Problems problems_;
};

TEST_F(SharedJobs, ASolverWorksForAllServersWhicheverItAsks) {
  const auto a = open("a"), b = open("b");
  const std::int64_t job = create(*b, 2);
  const Lease lease = claim(*a, "solver").value();
  EXPECT_EQ(lease.id.job, job);
  EXPECT_EQ(lease.server_address, "b.lab:7000");
  EXPECT_FALSE(lease.own);
  EXPECT_TRUE(a->own_jobs()->empty());
  EXPECT_EQ(b->own_jobs().value(), std::vector{job});
  EXPECT_FALSE(a->jobs()->at(0).own);
  EXPECT_EQ(a->jobs()->at(0).server_address, "b.lab:7000");
  EXPECT_FALSE(a->leases()->at(0).own);
  EXPECT_TRUE(b->leases()->at(0).own);
  EXPECT_OK(a->renew(lease.id));
  EXPECT_OK(b->complete(lease.id, result("x")));
  EXPECT_TRUE(absl::IsAborted(a->renew(lease.id)));
}

TEST_F(SharedJobs, HoldsAreEveryServersAndEndWithTheirOwn) {
  auto a = open("a"), b = open("b");
  const std::int64_t job = create(*b, 1);
  ASSERT_OK(b->suspend(job));
  EXPECT_FALSE(claim(*a, "solver").has_value());
  a = nullptr;
  a = open("a");
  EXPECT_FALSE(claim(*a, "solver").has_value());
  b = nullptr;
  b = open("b");
  EXPECT_TRUE(claim(*a, "solver").has_value());
}

TEST_F(SharedJobs, OneServersHintWakesThoseWhoWaitAtAnother) {
  const auto a = open("a"), b = open("b");
  // The first hint may come from the start of a's listener, so wait until all have arrived.
  std::jthread teller([&](std::stop_token stop) {
    while (!stop.stop_requested()) create(*b, 1);
  });
  const auto before = std::chrono::steady_clock::now();
  for (int i = 0; i < 3; ++i) a->wait_for_tiles(hours(1));
  EXPECT_LT(std::chrono::steady_clock::now() - before, hours(1));
}

TEST_F(SharedJobs, ManyServersStartAtOnce) {
  std::vector<std::jthread> threads;
  for (int i = 0; i < 6; ++i) {
    threads.emplace_back([&, id = std::to_string(i)] { EXPECT_GT(create(*open(id), 1), 0); });
  }
  threads.clear();
  EXPECT_EQ(open("a")->jobs()->size(), 6u);
}

TEST_F(SharedJobs, ManyServersHandOutEachTileOnce) {
  constexpr int kTiles = 120;
  const auto a = open("a"), b = open("b");
  const std::int64_t job = create(*a, kTiles);
  std::atomic<int> claims = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 12; ++i) {
    threads.emplace_back([&, i, solver = std::to_string(i)] {
      JobStore& store = i % 2 == 0 ? *a : *b;
      while (!store.counts(job)->rests()) {
        const std::optional<Lease> lease = claim(store, solver);
        if (!lease) continue;
        ++claims;
        EXPECT_OK(store.complete(lease->id, result(solver)));
      }
    });
  }
  threads.clear();
  EXPECT_EQ(claims, kTiles);
}

TEST_F(SharedJobs, NewerTablesAreRefused) {
  open("a");
  postgres_->run("UPDATE glasswing.version SET number = 5");
  const absl::Status refused = refusal(postgres_->connection());
  EXPECT_TRUE(absl::IsFailedPrecondition(refused)) << refused;
  EXPECT_NE(refused.message().find("version 5"), std::string::npos) << refused;
}

TEST_F(SharedJobs, TablesOfTheVersionBeforeAreUpgraded) {
  open("a");
  postgres_->run(
      "ALTER TABLE glasswing.tiles DROP COLUMN unsolved_pixels; "
      "ALTER TABLE glasswing.jobs DROP COLUMN priority, DROP COLUMN owner, DROP COLUMN deadline; "
      "UPDATE glasswing.version SET number = 1");
  const auto after = open("b");
  const std::int64_t job = create(*after, 1);
  ASSERT_OK(after->complete(claim(*after, "x")->id, result("tile")));
  EXPECT_EQ(after->counts(job)->unsolved_pixels, 2);
}

TEST_F(SharedJobs, ItsPasswordIsNotTold) {
  ASSERT_NE(postgres_->connection().find("secret"), std::string::npos);
  EXPECT_EQ(open("a")->title(), "PostgreSQL at 127.0.0.1");
  std::string wrong = postgres_->connection();
  wrong.replace(wrong.find("secret"), 6, "guessed");
  const absl::Status refused = refusal(wrong);
  EXPECT_TRUE(absl::IsUnavailable(refused)) << refused;
  EXPECT_NE(refused.message().find("127.0.0.1"), std::string::npos) << refused;
  EXPECT_EQ(refused.message().find("guessed"), std::string::npos) << refused;
}

TEST_F(SharedJobs, WhatWasAnsweredOutlivesAKilledDatabase) {
  constexpr int kTiles = 400, kThreads = 16, kBefore = 60;
  // A claim whose answer is lost by a kill ends with its lease.
  constexpr milliseconds kLease(2000);
  const auto a = open("a", milliseconds(0), kLease), b = open("b", milliseconds(0), kLease);
  const std::int64_t job = create(*a, kTiles);
  std::mutex mutex;
  std::map<int, std::string> answered;  // the result of each tile whose completion was answered OK
  std::atomic<int> unavailable = 0;
  std::atomic<bool> may_end = false;  // until then some tiles are left, so that every kill meets calls
  std::vector<std::jthread> threads;
  const auto answered_count = [&] {
    const std::lock_guard lock(mutex);
    return static_cast<int>(answered.size());
  };
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&, i] {
      JobStore& store = i % 2 == 0 ? *a : *b;
      const std::string solver = std::to_string(i);
      const auto is_gone = [&](const absl::Status& status) {
        EXPECT_TRUE(status.ok() || absl::IsUnavailable(status) || absl::IsAborted(status)) << status;
        if (!absl::IsUnavailable(status)) return false;
        ++unavailable;
        store.wait_for_tiles(milliseconds(20));
        return true;
      };
      for (;;) {
        const absl::StatusOr<JobCounts> counts = store.counts(job);
        if (counts.ok() && counts->rests()) return;
        if (is_gone(counts.status())) continue;
        if (!may_end && answered_count() >= kTiles - kThreads) continue;
        const absl::StatusOr<std::optional<Lease>> lease = store.claim(solver, kComputes, false);
        if (is_gone(lease.status()) || !lease->has_value()) continue;
        const std::string name = solver + "." + std::to_string((*lease)->id.attempt);
        absl::Status status;
        do {  // repeats, as a solver does, until it is answered
          status = store.complete((*lease)->id, result(name));
        } while (is_gone(status));
        if (!status.ok()) continue;
        const std::lock_guard lock(mutex);
        EXPECT_TRUE(answered.emplace((*lease)->id.tile, name).second);
      }
    });
  }
  for (int kills = 1; kills <= 2; ++kills) {
    EXPECT_TRUE(comes_true([&] { return answered_count() >= kills * kBefore; }));
    const int before = unavailable;
    postgres_->stop();
    EXPECT_TRUE(comes_true([&] { return unavailable > before; }));
    postgres_->start();
  }
  may_end = true;
  threads.clear();
  postgres_->restart();
  const auto after = open("a");
  EXPECT_EQ(after->counts(job)->done, kTiles);
  EXPECT_EQ(answered.size(), static_cast<size_t>(kTiles));
  for (const auto& [tile, name] : answered) {
    EXPECT_EQ(after->tile({.job = job, .tile = tile, .attempt = 1})->done.result, name);
  }
}

TEST_F(SharedJobs, WhileItIsGoneCallsSaySoAndThenGoOn) {
  const auto store = open("a");
  const std::int64_t job = create(*store, 1);
  postgres_->stop();
  const absl::Status gone = store->counts(job).status();
  EXPECT_TRUE(absl::IsUnavailable(gone)) << gone;
  EXPECT_NE(gone.message().find("PostgreSQL at 127.0.0.1"), std::string::npos) << gone;
  EXPECT_TRUE(absl::IsUnavailable(refusal(postgres_->connection())));
  postgres_->start();
  EXPECT_EQ(store->counts(job)->tiles, 1);
}

TEST_F(SharedJobs, OneThatIsOpenedBeforeItAnswersGoesOnOnceItDoes) {
  postgres_->stop();
  const auto store = open("a");
  const absl::Status gone = store->own_jobs().status();
  EXPECT_TRUE(absl::IsUnavailable(gone)) << gone;
  EXPECT_NE(gone.message().find("PostgreSQL at 127.0.0.1"), std::string::npos) << gone;
  postgres_->start();
  ASSERT_TRUE(comes_true([&] { return store->own_jobs().ok(); }));
  EXPECT_GT(create(*store, 1), 0);
  EXPECT_TRUE(claim(*store, "solver").has_value());
}

TEST(PostgresAddressTest, WhatCannotBeReadIsNotRepeated) {
  for (const std::string connection : {"secret", "host=lab secret", "postgresql://u:secret@[lab/x"}) {
    const absl::Status refused = refusal(connection);
    EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
    EXPECT_EQ(refused.message().find("secret"), std::string::npos) << refused;
  }
  EXPECT_EQ(PostgresAddress::parse("postgresql://u:secret@db.lab:77/x")->title(), "PostgreSQL at db.lab");
  EXPECT_EQ(PostgresAddress::parse("host=db.lab password=secret")->title(), "PostgreSQL at db.lab");
  EXPECT_EQ(PostgresAddress::parse("dbname=x")->title(), "PostgreSQL");
}

}  // namespace
}  // namespace glasswing
