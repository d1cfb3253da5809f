// What the two job stores have in common: one schema, one set of statements. A store adds how a connection is
// had, how changes become durable, and the clock.
//
// A tile's leases stand in its own row, two at most, so that each change of a tile is one statement on one
// row; what it asks of the row is asked again if another change came in between. Times are microseconds of
// the store's clock.
#pragma once

#include <absl/functional/function_ref.h>

#include <condition_variable>
#include <mutex>
#include <variant>

#include "server/jobs/job_store.h"

namespace glasswing {

struct SqlBytes {
  std::string bytes;
};
using SqlValue = std::variant<std::int64_t, double, std::string, SqlBytes>;
using SqlValues = std::vector<SqlValue>;

class SqlRows {
 public:
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  size_t size() const { return rows_.size(); }
  bool empty() const { return rows_.empty(); }
  const std::string& text(size_t row, size_t column) const { return rows_[row][column]; }
  std::int64_t integer(size_t row, size_t column) const;
  double real(size_t row, size_t column) const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

// Statements have their values as ?1, ?2 ..., the time as :now, and :locking where rows that another change
// has locked are to be passed over.
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;
  virtual absl::StatusOr<SqlRows> run(const std::string& sql, const SqlValues& values) = 0;
};

class SqlJobStore : public JobStore {
 public:
  absl::StatusOr<std::int64_t> create(const JobSpec& spec, std::span<const TileRange> tiles) override;
  absl::Status recut(const TileAttempt& survey, const std::string& work,
                     std::span<const TileRange> tiles) override;
  absl::Status add(std::int64_t job, std::span<const TileRange> tiles) override;
  absl::Status retry(std::int64_t job) override;
  absl::Status suspend(std::int64_t job) override;
  absl::Status resume(std::int64_t job) override;
  absl::Status remove(std::int64_t job) override;
  absl::StatusOr<std::vector<std::int64_t>> own_jobs() override;

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

  // All of it durable, or nothing of it and the error. It may be called more than once.
  virtual absl::Status transaction(Change change) = 0;
  // Each statement durable by itself.
  virtual absl::Status statements(Change change) = 0;
  // Statements that change nothing.
  virtual absl::StatusOr<SqlRows> read(const std::string& sql, const SqlValues& values) = 0;
  // A statement for job and number of the first tile that is `free`, of the oldest job that is `open`: it
  // goes from job to job, so that what an index still holds of tiles long done or gone is not in the way.
  virtual std::string oldest_tile(const std::string& open, const std::string& free) const = 0;
  // Tells the other servers, if any, that tiles may have become free.
  virtual void tell_others() {}

  void tiles_became_free();
  void hinted();

  const JobStoreOptions options_;

 private:
  absl::Status change_job(std::int64_t job, const std::string& sql);

  std::mutex hint_mutex_;
  std::condition_variable hint_;
  std::int64_t hints_ = 0;       // guarded by hint_mutex_
  std::int64_t hints_seen_ = 0;  // likewise
};

}  // namespace glasswing
