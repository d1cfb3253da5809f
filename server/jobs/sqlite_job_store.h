// The job store in a SQLite file of one server. Changes that arrive while the disk is busy are committed
// together.
#pragma once

#include "server/jobs/sql_job_store.h"
#include "server/storage/database.h"

namespace glasswing {

// Its clock is the time since boot, so leases stay valid when the server restarts; those of an earlier boot
// have expired.
class SqliteJobStore : public SqlJobStore {
 public:
  // A file of an earlier version was never released, and is recreated. DATA_LOSS: the file is damaged.
  static absl::StatusOr<std::unique_ptr<SqliteJobStore>> open(const std::filesystem::path& path,
                                                              JobStoreOptions options);
  // Without a file, and gone with the object.
  static absl::StatusOr<std::unique_ptr<SqliteJobStore>> open_in_memory(JobStoreOptions options);
  // For checking the file while no server is running: opens it as it is, whichever server it belongs to. Its
  // version must be the current one.
  static absl::StatusOr<std::unique_ptr<SqliteJobStore>> open_unclaimed(const std::filesystem::path& path);
  std::string title() const override { return "SQLite"; }

 protected:
  absl::Status transaction(Change change) override;
  absl::Status statements(Change change) override;
  absl::StatusOr<SqlRows> read(const std::string& sql, const SqlValues& values) override;
  std::string next_tile(const std::string& open, const std::string& free, bool rivals) const override;

 private:
  struct Waiting {
    Change change;
    bool atomic = false;
    bool is_done = false;
    absl::Status status;
  };

  SqliteJobStore(Database writer, std::optional<Database> reader, JobStoreOptions options)
      : SqlJobStore(std::move(options)), writer_(std::move(writer)), reader_(std::move(reader)) {}
  absl::Status prepare();
  absl::Status commit(Waiting waiting);
  void commit_all(std::span<Waiting* const> batch);

  std::mutex mutex_;
  std::condition_variable committed_;
  std::vector<Waiting*> waiting_;  // guarded by mutex_
  bool is_committing_ = false;     // guarded by mutex_
  Database writer_;                // used by the thread that set is_committing_
  std::mutex reader_mutex_;
  std::optional<Database> reader_;  // guarded by reader_mutex_; none in memory
};

}  // namespace glasswing
