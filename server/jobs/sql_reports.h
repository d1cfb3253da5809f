// The statements that report tiles, counts, jobs and leases; errors are the reader's.
#pragma once

#include <vector>

#include "server/jobs/job_store.h"
#include "server/jobs/sql_connection.h"

namespace glasswing {

absl::StatusOr<std::vector<std::int64_t>> report_jobs_of(SqlReader& reader, const std::string& server);
absl::StatusOr<std::vector<TileState>> report_tiles(SqlReader& reader, std::int64_t job);
// ABORTED: no such tile.
absl::StatusOr<TileState> report_tile(SqlReader& reader, const TileAttempt& id);
absl::StatusOr<JobCounts> report_counts(SqlReader& reader, std::int64_t job);
// Jobs with open tiles, and leases, of all servers.
absl::StatusOr<std::vector<JobState>> report_jobs(SqlReader& reader, const std::string& own_server);
absl::StatusOr<std::vector<LeaseState>> report_leases(SqlReader& reader, const std::string& own_server);

}  // namespace glasswing
