// The contract suite of every kind of job store.
#pragma once

#include <gtest/gtest.h>

#include "server/jobs/job_store.h"
#include "tests/server/jobs/helpers.h"

namespace glasswing {

// The directory of a store's data, removed with the object.
class JobBackend {
 public:
  virtual ~JobBackend() = default;
  virtual std::unique_ptr<JobStore> open(const JobStoreOptions& options) = 0;

  Problems problems_;
};

class JobContract : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override;

  // By default leases do not expire, and no tile is handed out twice.
  static JobStoreOptions options(std::chrono::milliseconds lease = std::chrono::hours(1),
                                 std::chrono::milliseconds least_before_twice = std::chrono::hours(1));
  // Closes the store that is open, if any, first.
  void open(const JobStoreOptions& options);
  // A job of "session", computing "gaussian/1", with work "work" and tiles of 4 rows each.
  std::int64_t create(int tiles, const std::string& session = "session");
  std::optional<Lease> claim(const std::string& solver, bool ahead = false);
  Lease claimed(const std::string& solver);
  // Claims until there is a tile.
  Lease claim_at_last(const std::string& solver);
  TileState tile(const Lease& lease) { return store_->tile(lease.id).value(); }

  std::unique_ptr<JobBackend> backend_;
  std::unique_ptr<JobStore> store_;
};

}  // namespace glasswing
