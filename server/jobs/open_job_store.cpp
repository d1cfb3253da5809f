#include "server/jobs/job_store.h"
#include "server/jobs/postgres_job_store.h"
#include "server/jobs/sqlite_job_store.h"

namespace glasswing {

absl::StatusOr<std::unique_ptr<JobStore>> open_job_store(const std::string& connection,
                                                         const std::filesystem::path& data,
                                                         JobStoreOptions options) {
  if (connection.empty()) return SqliteJobStore::open(data / "jobs.sqlite", std::move(options));
  return PostgresJobStore::open(connection, std::move(options));
}

}  // namespace glasswing
