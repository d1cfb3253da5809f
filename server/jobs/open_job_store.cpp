#include "core/base/status.h"
#include "server/jobs/job_store.h"
#include "server/jobs/postgres_job_store.h"
#include "server/jobs/sqlite_job_store.h"

namespace glasswing {
absl::StatusOr<std::unique_ptr<JobStore>> open_job_store(const std::string& connection,
                                                         const std::filesystem::path& data,
                                                         JobStoreOptions options, Problems& problems) {
  if (!connection.empty()) return PostgresJobStore::open(connection, std::move(options));
  const std::filesystem::path file = data / "jobs.sqlite";
  absl::StatusOr<std::unique_ptr<SqliteJobStore>> store = SqliteJobStore::open(file, options);
  if (absl::IsDataLoss(store.status())) {
    GW_RETURN_IF_ERROR(problems.set_aside_database(data, file, store.status(),
                                                   "solves that were in progress must be requested again"));
    store = SqliteJobStore::open(file, std::move(options));
  }
  return store;
}

absl::StatusOr<std::unique_ptr<JobStore>> open_job_store_in_memory(JobStoreOptions options) {
  return SqliteJobStore::open_in_memory(std::move(options));
}

}  // namespace glasswing
