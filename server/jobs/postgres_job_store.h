// The job store in a PostgreSQL database that several servers may share. The first server creates the tables,
// in the schema "glasswing".
#pragma once

#include <thread>

#include "server/jobs/postgres_connection.h"
#include "server/jobs/sql_job_store.h"

namespace glasswing {

// Uses the database's clock.
class PostgresJobStore : public SqlJobStore {
 public:
  // If the database does not answer yet, every call fails with UNAVAILABLE until it does.
  static absl::StatusOr<std::unique_ptr<PostgresJobStore>> open(const std::string& connection,
                                                                JobStoreOptions options);
  std::string title() const override { return address_.title(); }

 protected:
  absl::Status transaction(Change change) override;
  absl::Status statements(Change change) override;
  absl::StatusOr<SqlRows> read(const std::string& sql, const SqlValues& values) override;
  std::string next_tile(const std::string& open, const std::string& free, bool rivals) const override;
  void tell_others() override;

 private:
  PostgresJobStore(PostgresAddress address, JobStoreOptions options)
      : SqlJobStore(std::move(options)), address_(std::move(address)) {}
  // Creates the tables if they do not exist, and resumes this server's jobs.
  absl::Status prepare(PostgresConnection& connection);
  absl::Status try_to_prepare();
  absl::Status ready();  // UNAVAILABLE: not prepared yet
  // Calls `use` with a connection of the pool, and again if it failed only because of a concurrent change.
  absl::Status with_connection(absl::FunctionRef<absl::Status(PostgresConnection&)> use);
  absl::StatusOr<std::unique_ptr<PostgresConnection>> borrow();
  void give_back(std::unique_ptr<PostgresConnection> connection);
  // Prepares the store once the database answers, then receives other servers' hints until stopped.
  void listen(std::stop_token stop);

  const PostgresAddress address_;
  std::mutex mutex_;
  absl::Status ready_ = absl::UnavailableError("");  // why it is not prepared; guarded by mutex_
  std::condition_variable given_back_;
  std::vector<std::unique_ptr<PostgresConnection>> idle_;  // guarded by mutex_
  int borrowed_ = 0;                                       // guarded by mutex_
  std::jthread listener_;
};

}  // namespace glasswing
