#include "server/jobs/sql_job_store.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "core/base/name.h"
#include "core/base/status.h"
#include "server/jobs/sql_leases.h"
#include "server/jobs/sql_reports.h"
#include "server/jobs/sql_text.h"

namespace glasswing {
namespace {

// Limits a statement to some tens of kilobytes.
constexpr size_t kTilesAStatement = 1000;

// The values are numbers only, so they need no parameters.
absl::Status insert(SqlConnection& connection, std::int64_t job, std::int64_t number, std::int64_t attempts,
                    std::span<const TileRange> ranges) {
  while (!ranges.empty()) {
    std::vector<std::string> rows;
    for (const TileRange& range : ranges.first(std::min(ranges.size(), kTilesAStatement))) {
      rows.push_back(fmt::format("({}, {}, {}, {}, {})", job, number++, range.first, range.count, attempts));
    }
    ranges = ranges.subspan(rows.size());
    GW_RETURN_IF_ERROR(
        connection
            .run(fmt::format("INSERT INTO tiles (job, number, first, count, attempts) VALUES {}",
                             fmt::join(rows, ", ")),
                 {})
            .status());
  }
  return absl::OkStatus();
}

// Locks the job's row, so that such changes run one after another.
absl::Status find_job(SqlConnection& connection, std::int64_t job) {
  GW_ASSIGN_OR_RETURN(const SqlRows found,
                      connection.run("UPDATE jobs SET held = held WHERE id = ?1 RETURNING id", {job}));
  if (found.empty()) return absl::NotFoundError(fmt::format("there is no job {}", job));
  return absl::OkStatus();
}

absl::Status is_void(const TileAttempt& attempt) {
  return absl::AbortedError(
      fmt::format("attempt {} at tile {} of job {} is void: the tile is done or removed, or its lease ended "
                  "and it was handed out again",
                  attempt.attempt, attempt.tile, attempt.job));
}

}  // namespace

absl::StatusOr<std::int64_t> SqlJobStore::create(const JobSpec& spec, std::span<const TileRange> tiles) {
  std::int64_t job = 0;
  const absl::Status status = transaction([&](SqlConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(
        const SqlRows created,
        connection.run("INSERT INTO jobs (server, session, computes, work, owner, created) "
                       "VALUES (?1, ?2, ?3, ?4, ?5, :now) RETURNING id",
                       {options_.server_id, spec.session, spec.computes, SqlBytes{spec.work}, spec.owner}));
    job = created.integer(0, 0);
    return insert(connection, job, 0, 0, tiles);
  });
  GW_RETURN_IF_ERROR(status);
  tiles_became_free();
  return job;
}

absl::Status SqlJobStore::recut(const TileAttempt& survey, const std::string& work,
                                std::span<const TileRange> tiles) {
  const SqlValues attempt{survey.job, std::int64_t{survey.tile}, std::int64_t{survey.attempt}};
  const absl::Status status = transaction([&](SqlConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(
        const SqlRows before,
        connection.run("UPDATE jobs SET held = held WHERE id = ?1 RETURNING CASE WHEN "
                       "survey_tile = ?2 AND survey_attempt = ?3 AND ?3 > 0 THEN 1 ELSE 0 END",
                       attempt));
    if (before.empty()) return is_void(survey);
    if (before.integer(0, 0) != 0) return absl::OkStatus();
    GW_ASSIGN_OR_RETURN(
        const SqlRows held,
        connection.run(fmt::format("DELETE FROM tiles WHERE {} RETURNING attempts", kAttempt), attempt));
    if (held.empty()) return is_void(survey);
    GW_ASSIGN_OR_RETURN(const SqlRows others,
                        connection.run("DELETE FROM tiles WHERE job = ?1 RETURNING attempts", {survey.job}));
    GW_RETURN_IF_ERROR(
        connection
            .run("UPDATE jobs SET survey_tile = ?2, survey_attempt = ?3, work = ?4 WHERE id = ?1",
                 {survey.job, std::int64_t{survey.tile}, std::int64_t{survey.attempt}, SqlBytes{work}})
            .status());
    // New attempts are numbered after the old ones, so that an old attempt never refers to a new tile.
    std::int64_t attempts = held.integer(0, 0);
    for (size_t i = 0; i < others.size(); ++i) attempts = std::max(attempts, others.integer(i, 0));
    return insert(connection, survey.job, 0, attempts, tiles);
  });
  GW_RETURN_IF_ERROR(status);
  tiles_became_free();
  return absl::OkStatus();
}

absl::Status SqlJobStore::add(std::int64_t job, std::span<const TileRange> tiles) {
  const absl::Status status = transaction([&](SqlConnection& connection) -> absl::Status {
    GW_RETURN_IF_ERROR(find_job(connection, job));
    GW_ASSIGN_OR_RETURN(
        const SqlRows last,
        connection.run(
            "SELECT coalesce(max(number) + 1, 0), coalesce(max(attempts), 0) FROM tiles WHERE job = ?1",
            {job}));
    return insert(connection, job, last.integer(0, 0), last.integer(0, 1), tiles);
  });
  GW_RETURN_IF_ERROR(status);
  tiles_became_free();
  return absl::OkStatus();
}

absl::Status SqlJobStore::set_class(std::int64_t job, JobClass priority) {
  GW_RETURN_IF_ERROR(change_job(
      job, fmt::format("UPDATE jobs SET priority = {} WHERE id = ?1", static_cast<int>(priority))));
  tiles_became_free();  // for other solvers than before
  return absl::OkStatus();
}

absl::Status SqlJobStore::set_deadline(std::int64_t job, absl::Time deadline) {
  const std::int64_t at_us = deadline == absl::InfiniteFuture() ? 0 : absl::ToUnixMicros(deadline);
  GW_RETURN_IF_ERROR(change_job(job, fmt::format("UPDATE jobs SET deadline = {} WHERE id = ?1", at_us)));
  tiles_became_free();
  return absl::OkStatus();
}

absl::Status SqlJobStore::retry(std::int64_t job) {
  GW_RETURN_IF_ERROR(
      change_job(job, "UPDATE tiles SET quarantined = 0, failures = 0, lost = 0 WHERE job = ?1"));
  tiles_became_free();
  return absl::OkStatus();
}

absl::Status SqlJobStore::suspend(std::int64_t job) {
  return change_job(job, "UPDATE jobs SET held = 1 WHERE id = ?1");
}

absl::Status SqlJobStore::resume(std::int64_t job) {
  GW_RETURN_IF_ERROR(change_job(job, "UPDATE jobs SET held = 0 WHERE id = ?1"));
  tiles_became_free();
  return absl::OkStatus();
}

absl::Status SqlJobStore::change_job(std::int64_t job, const std::string& sql) {
  return transaction([&](SqlConnection& connection) -> absl::Status {
    GW_RETURN_IF_ERROR(find_job(connection, job));
    return connection.run(sql, {job}).status();
  });
}

absl::Status SqlJobStore::requeue(std::int64_t job, int tile) {
  GW_RETURN_IF_ERROR(statements([&](SqlConnection& connection) {
    return connection
        .run(fmt::format(
                 "UPDATE tiles SET done_attempt = 0, done_at = 0, result = '', object_pixels = 0, "
                 "flagged_pixels = 0, unsolved_pixels = 0, seconds = 0, {} WHERE job = ?1 AND number = ?2",
                 kNoLease),
             {job, std::int64_t{tile}})
        .status();
  }));
  tiles_became_free();
  return absl::OkStatus();
}

absl::Status SqlJobStore::remove(std::int64_t job) {
  return statements([&](SqlConnection& connection) {
    return connection.run("DELETE FROM jobs WHERE id = ?1", {job}).status();
  });
}

absl::StatusOr<std::string> SqlJobStore::lease_key() {
  std::string key;
  const absl::Status status = transaction([&](SqlConnection& connection) -> absl::Status {
    GW_RETURN_IF_ERROR(
        connection
            .run("CREATE TABLE IF NOT EXISTS lease_key (one INTEGER PRIMARY KEY, secret TEXT NOT NULL)", {})
            .status());
    GW_RETURN_IF_ERROR(
        connection.run("INSERT INTO lease_key VALUES (1, ?1) ON CONFLICT DO NOTHING", {random_token()})
            .status());
    GW_ASSIGN_OR_RETURN(const SqlRows found, connection.run("SELECT secret FROM lease_key", {}));
    key = found.text(0, 0);
    return absl::OkStatus();
  });
  GW_RETURN_IF_ERROR(status);
  return key;
}

absl::StatusOr<bool> SqlJobStore::has_rivals(SqlConnection& connection) {
  constexpr std::chrono::milliseconds kHolds(200);
  const auto now = std::chrono::steady_clock::now();
  {
    const std::lock_guard lock(rivals_mutex_);
    if (now < rivals_until_) return rivals_;
  }
  GW_ASSIGN_OR_RETURN(const SqlRows found,
                      connection.run("SELECT CASE WHEN min(owner) <> max(owner) OR min(priority) <> "
                                     "max(priority) OR max(deadline) > 0 THEN 1 ELSE 0 END FROM jobs",
                                     {}));
  const std::lock_guard lock(rivals_mutex_);
  rivals_until_ = now + kHolds;
  return rivals_ = found.integer(0, 0) != 0;
}

absl::StatusOr<std::optional<Lease>> SqlJobStore::claim(const std::string& solver,
                                                        std::span<const std::string> computes, bool ahead) {
  std::optional<Lease> lease;
  if (computes.empty()) return lease;
  const absl::Status status = statements([&](SqlConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(const bool rivals, has_rivals(connection));
    const auto next = [&](const std::string& open, const std::string& free) {
      return next_tile(open, free, rivals);
    };
    GW_ASSIGN_OR_RETURN(lease, claim_tile(connection, solver, computes, ahead, options_, next));
    return absl::OkStatus();
  });
  GW_RETURN_IF_ERROR(status);
  return lease;
}

absl::StatusOr<bool> SqlJobStore::fail(const TileAttempt& lease, const std::string& error, bool permanent) {
  FailedAttempt failed;
  const absl::Status status = transaction([&](SqlConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(failed, fail_attempt(connection, lease, error, permanent));
    return absl::OkStatus();
  });
  GW_RETURN_IF_ERROR(status);
  if (failed.had_lease) tiles_became_free();
  return failed.quarantined;
}

absl::Status SqlJobStore::hand_back(const TileAttempt& lease) {
  bool had_lease = false;
  const absl::Status status = statements([&](SqlConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(had_lease, end_attempt(connection, lease));
    return absl::OkStatus();
  });
  GW_RETURN_IF_ERROR(status);
  if (had_lease) tiles_became_free();
  return absl::OkStatus();
}

absl::Status SqlJobStore::renew(const TileAttempt& lease) {
  return statements([&](SqlConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(
        const SqlRows kept,
        connection.run(
            fmt::format("UPDATE tiles SET "
                        "lease_until = CASE WHEN lease_attempt = ?3 THEN :now + ?4 ELSE lease_until END, "
                        "twin_until = CASE WHEN twin_attempt = ?3 THEN :now + ?4 ELSE twin_until END "
                        "WHERE {} RETURNING number",
                        kAttempt),
            {lease.job, std::int64_t{lease.tile}, std::int64_t{lease.attempt},
             std::chrono::microseconds(options_.lease).count()}));
    return kept.empty() ? is_void(lease) : absl::OkStatus();
  });
}

absl::Status SqlJobStore::complete(const TileAttempt& lease, const TileResult& result) {
  if (result.result.empty())
    return absl::InvalidArgumentError("the result of a tile is empty; it must not be");
  return statements([&](SqlConnection& connection) -> absl::Status {
    GW_ASSIGN_OR_RETURN(
        const SqlRows done,
        connection.run(
            fmt::format("UPDATE tiles SET done_attempt = ?3, done_at = :now, result = ?4, "
                        "object_pixels = ?5, flagged_pixels = ?6, seconds = ?7, unsolved_pixels = ?8, {} "
                        "WHERE {} RETURNING number",
                        kNoLease, kAttempt),
            {lease.job, std::int64_t{lease.tile}, std::int64_t{lease.attempt}, SqlBytes{result.result},
             result.object_pixels, result.flagged_pixels, result.seconds, result.unsolved_pixels}));
    if (!done.empty()) return absl::OkStatus();
    GW_ASSIGN_OR_RETURN(
        const SqlRows before,
        connection.run("SELECT 1 FROM tiles WHERE job = ?1 AND number = ?2 AND done_attempt = ?3 "
                       "AND done_attempt > 0",
                       {lease.job, std::int64_t{lease.tile}, std::int64_t{lease.attempt}}));
    return before.empty() ? is_void(lease) : absl::OkStatus();
  });
}

absl::StatusOr<std::vector<std::int64_t>> SqlJobStore::own_jobs() {
  return report_jobs_of(*this, options_.server_id);
}
absl::StatusOr<std::vector<TileState>> SqlJobStore::tiles(std::int64_t job) {
  return report_tiles(*this, job);
}
absl::StatusOr<TileState> SqlJobStore::tile(const TileAttempt& id) {
  return report_tile(*this, id);
}
absl::StatusOr<JobCounts> SqlJobStore::counts(std::int64_t job) {
  return report_counts(*this, job);
}
absl::StatusOr<std::vector<JobState>> SqlJobStore::jobs() {
  return report_jobs(*this, options_.server_id);
}
absl::StatusOr<std::vector<LeaseState>> SqlJobStore::leases() {
  return report_leases(*this, options_.server_id);
}

void SqlJobStore::tiles_became_free() {
  {
    const std::lock_guard lock(rivals_mutex_);
    rivals_until_ = {};
  }
  hinted();
  tell_others();
}

void SqlJobStore::hinted() {
  const std::lock_guard lock(hint_mutex_);
  ++hints_;
  hint_.notify_all();
}

void SqlJobStore::wait_for_tiles(std::chrono::milliseconds timeout) {
  std::unique_lock lock(hint_mutex_);
  // One hint wakes every waiting thread.
  const std::int64_t seen = hints_seen_;
  hint_.wait_for(lock, timeout, [&] { return hints_ != seen; });
  hints_seen_ = hints_;
}

}  // namespace glasswing
