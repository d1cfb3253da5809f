// The part that both job stores share: one schema, one set of statements. A store adds its connections, its
// transactions and its clock.
//
// A tile's leases, at most two, are columns of its row, so each change of a tile is one statement on one row,
// whose conditions are evaluated again after a concurrent change. Times are microseconds of the store's
// clock.
#pragma once

#include <absl/functional/function_ref.h>

#include <condition_variable>
#include <mutex>

#include "server/jobs/job_store.h"
#include "server/jobs/sql_connection.h"

namespace glasswing {

class SqlJobStore : public JobStore, protected SqlReader {
 public:
  absl::StatusOr<std::int64_t> create(const JobSpec& spec, std::span<const TileRange> tiles) override;
  absl::Status recut(const TileAttempt& survey, const std::string& work,
                     std::span<const TileRange> tiles) override;
  absl::Status add(std::int64_t job, std::span<const TileRange> tiles) override;
  absl::Status set_class(std::int64_t job, JobClass priority) override;
  absl::Status set_deadline(std::int64_t job, absl::Time deadline) override;
  absl::Status retry(std::int64_t job) override;
  absl::Status suspend(std::int64_t job) override;
  absl::Status resume(std::int64_t job) override;
  absl::Status requeue(std::int64_t job, int tile) override;
  absl::Status remove(std::int64_t job) override;
  absl::StatusOr<std::vector<std::int64_t>> own_jobs() override;
  absl::StatusOr<std::string> lease_key() override;

  absl::StatusOr<std::optional<Lease>> claim(const std::string& solver, std::span<const std::string> computes,
                                             bool ahead) override;
  absl::Status renew(const TileAttempt& lease) override;
  absl::Status complete(const TileAttempt& lease, const TileResult& result) override;
  absl::StatusOr<bool> fail(const TileAttempt& lease, const std::string& error, bool permanent) override;
  absl::Status hand_back(const TileAttempt& lease) override;

  absl::StatusOr<std::vector<TileState>> tiles(std::int64_t job) override;
  absl::StatusOr<TileState> tile(const TileAttempt& id) override;
  absl::StatusOr<JobCounts> counts(std::int64_t job) override;
  absl::StatusOr<std::vector<JobState>> jobs() override;
  absl::StatusOr<std::vector<LeaseState>> leases() override;

  void wait_for_tiles(std::chrono::milliseconds timeout) override;

 protected:
  using Change = absl::FunctionRef<absl::Status(SqlConnection&)>;

  explicit SqlJobStore(JobStoreOptions options) : options_(std::move(options)) {}

  // Runs `change` atomically: durable on OK, otherwise without effect. May call it more than once.
  virtual absl::Status transaction(Change change) = 0;
  // Each statement of `change` is durable by itself.
  virtual absl::Status statements(Change change) = 0;
  // The statement that selects job and number of the first `free` tile of the first `open` job (job_order()).
  // It goes from job to job, so that dead index entries of finished or removed tiles do not slow it. Without
  // rivals the oldest job is the first.
  virtual std::string next_tile(const std::string& open, const std::string& free, bool rivals) const = 0;
  // Hints to the other servers, if any, that tiles may have become free.
  virtual void tell_others() {}

  void tiles_became_free();
  void hinted();

  const JobStoreOptions options_;

 private:
  absl::Status change_job(std::int64_t job, const std::string& sql);
  // True if jobs are of several owners or classes; what other servers changed is seen a little later.
  absl::StatusOr<bool> has_rivals(SqlConnection& connection);

  std::mutex rivals_mutex_;
  bool rivals_ = false;                                   // guarded by rivals_mutex_
  std::chrono::steady_clock::time_point rivals_until_{};  // it holds; guarded by rivals_mutex_

  std::mutex hint_mutex_;
  std::condition_variable hint_;
  std::int64_t hints_ = 0;       // guarded by hint_mutex_
  std::int64_t hints_seen_ = 0;  // guarded by hint_mutex_
};

}  // namespace glasswing
