// Concurrent claims.
#include <atomic>
#include <set>
#include <thread>

#include "tests/server/jobs/contract.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST_P(JobContract, EachTileIsHandedOutOnceToManyAtOnce) {
  constexpr int kTiles = 200, kThreads = 16;
  const std::int64_t first = create(kTiles / 2), second = create(kTiles / 2, "other");
  std::mutex mutex;
  std::set<std::pair<std::int64_t, int>> seen;
  std::atomic<int> claims = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&, solver = "solver" + std::to_string(i)] {
      // Rows that others have locked are skipped, so an empty answer is not the end.
      while (!(store_->counts(first)->rests() && store_->counts(second)->rests())) {
        const std::optional<Lease> lease = claim(solver);
        if (!lease) continue;
        ++claims;
        EXPECT_OK(store_->renew(lease->id));
        EXPECT_OK(store_->complete(lease->id, result(solver)));
        const std::lock_guard lock(mutex);
        EXPECT_TRUE(seen.insert({lease->id.job, lease->id.tile}).second);
      }
    });
  }
  threads.clear();
  EXPECT_EQ(claims, kTiles);
  EXPECT_EQ(store_->counts(first)->done + store_->counts(second)->done, kTiles);
}

TEST_P(JobContract, OfManyAtOneTileOneIsFirst) {
  open(options(std::chrono::hours(1), std::chrono::milliseconds(0)));
  constexpr int kTiles = 40;
  const std::int64_t job = create(kTiles);
  std::atomic<int> done = 0, refused = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, solver = "solver" + std::to_string(i)] {
      std::vector<Lease> leases;  // all, before any is completed, so that many are handed out twice
      while (std::optional<Lease> lease = claim(solver)) leases.push_back(*lease);
      for (const Lease& lease : leases) {
        const absl::Status status = store_->complete(lease.id, result(solver));
        EXPECT_TRUE(status.ok() || absl::IsAborted(status)) << status;
        ++(status.ok() ? done : refused);
      }
    });
  }
  threads.clear();
  // Tiles that were skipped while locked.
  while (std::optional<Lease> lease = claim("last")) {
    ASSERT_OK(store_->complete(lease->id, result("last")));
    ++done;
  }
  EXPECT_EQ(done, kTiles);
  EXPECT_TRUE(store_->counts(job)->rests());
}

}  // namespace
}  // namespace glasswing
