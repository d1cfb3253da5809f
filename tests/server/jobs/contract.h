// One suite for every kind of job store.
#pragma once

#include <gtest/gtest.h>

#include "server/jobs/job_store.h"
#include "tests/server/jobs/helpers.h"

namespace glasswing {

// Where a store's data are; removed with it.
class JobBackend {
 public:
  virtual ~JobBackend() = default;
  virtual std::unique_ptr<JobStore> open(const JobStoreOptions& options) = 0;
};

class JobContract : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override;

  // Leases that do not end, and nothing is handed out twice, unless a test says otherwise.
  static JobStoreOptions options(std::chrono::milliseconds lease = std::chrono::hours(1),
                                 std::chrono::milliseconds least_before_twice = std::chrono::hours(1));
  // The store of before, if any, is closed first.
  void open(const JobStoreOptions& options);
  // Of "session", computing "gaussian/1", work "work"; tiles of 4 rows each.
  std::int64_t create(int tiles, const std::string& session = "session");
  std::optional<Lease> claim(const std::string& solver, bool ahead = false);
  Lease claimed(const std::string& solver);
  // Asks until there is one.
  Lease claim_at_last(const std::string& solver);
  TileState tile(const Lease& lease) { return store_->tile(lease.id).value(); }

  std::unique_ptr<JobBackend> backend_;
  std::unique_ptr<JobStore> store_;
};

}  // namespace glasswing
