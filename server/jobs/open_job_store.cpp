#include "core/base/set_aside.h"
#include "core/base/status.h"
#include "server/jobs/job_store.h"
#include "server/jobs/postgres_job_store.h"
#include "server/jobs/sqlite_job_store.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// SQLite would take the log of a damaged file for that of the new one.
absl::Status set_aside_with_log(const fs::path& data, const fs::path& file, const absl::Status& damage,
                                Problems& problems) {
  for (const char* log : {"-wal", "-shm"}) {
    const fs::path path = file.string() + log;
    if (fs::exists(path)) GW_RETURN_IF_ERROR(set_aside(data, path));
  }
  return problems.set_aside(data, file, damage, "solves that were under way must be requested again");
}

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> open_job_store(const std::string& connection, const fs::path& data,
                                                         JobStoreOptions options, Problems& problems) {
  if (!connection.empty()) return PostgresJobStore::open(connection, std::move(options));
  const fs::path file = data / "jobs.sqlite";
  absl::StatusOr<std::unique_ptr<SqliteJobStore>> store = SqliteJobStore::open(file, options);
  if (absl::IsDataLoss(store.status())) {
    GW_RETURN_IF_ERROR(set_aside_with_log(data, file, store.status(), problems));
    store = SqliteJobStore::open(file, std::move(options));
  }
  return store;
}

}  // namespace glasswing
