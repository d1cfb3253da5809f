// Tiles in a SQLite file of one server. Changes that are asked for while the disk is busy are made durable
// together.
#pragma once

#include "server/jobs/sql_job_store.h"
#include "server/storage/database.h"

namespace glasswing {

// Its clock is the machine's time since boot, so a server that was started again goes on with the leases it
// gave; leases of an earlier boot have ended.
class SqliteJobStore : public SqlJobStore {
 public:
  // A file of an earlier version, which nothing was released with, is begun anew.
  static absl::StatusOr<std::unique_ptr<SqliteJobStore>> open(const std::filesystem::path& path,
                                                              JobStoreOptions options);
  // For a check of the file while no server runs: takes it as it is, whichever server's it is. Its version
  // must be this one's.
  static absl::StatusOr<std::unique_ptr<SqliteJobStore>> open_unclaimed(const std::filesystem::path& path);
  std::string title() const override { return "SQLite"; }

 protected:
  absl::Status transaction(Change change) override;
  absl::Status statements(Change change) override;
  absl::StatusOr<SqlRows> read(const std::string& sql, const SqlValues& values) override;
  std::string oldest_tile(const std::string& open, const std::string& free) const override;

 private:
  struct Waiting {
    Change change;
    bool atomic = false;
    bool is_done = false;
    absl::Status status;
  };

  SqliteJobStore(Database writer, Database reader, JobStoreOptions options)
      : SqlJobStore(std::move(options)), writer_(std::move(writer)), reader_(std::move(reader)) {}
  absl::Status prepare();
  absl::Status commit(Waiting waiting);
  void commit_all(std::span<Waiting* const> batch);

  std::mutex mutex_;
  std::condition_variable committed_;
  std::vector<Waiting*> waiting_;  // guarded by mutex_
  bool is_committing_ = false;     // likewise
  Database writer_;                // of whoever set is_committing_
  std::mutex reader_mutex_;
  Database reader_;  // guarded by reader_mutex_
};

}  // namespace glasswing
