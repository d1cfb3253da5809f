#include "server/jobs/job_store.h"
#include "server/jobs/sqlite_job_store.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<JobStore>> open_job_store(const std::string& connection,
                                                         const std::filesystem::path& data,
                                                         JobStoreOptions options) {
  if (connection.empty()) return SqliteJobStore::open(data / "jobs.sqlite", std::move(options));
  // What was given is not repeated: it may have a password in it.
  return absl::InvalidArgumentError("the job store's connection cannot be read; it must be empty (SQLite)");
}

}  // namespace glasswing
