#include "server/jobs/sql_leases.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/base/status.h"
#include "server/jobs/sql_text.h"

namespace glasswing {
namespace {

constexpr char kLeaseOfClaim[] =
    " RETURNING job, number, attempts, first, count, (SELECT session FROM jobs WHERE id = job), "
    "(SELECT work FROM jobs WHERE id = job), (SELECT server FROM jobs WHERE id = job), "
    "(SELECT address FROM servers WHERE id = (SELECT server FROM jobs WHERE id = job)), lost";

// Assignments that keep the first lease where `condition` holds, otherwise replace it with the second.
std::string first_lease_if(const std::string& condition) {
  std::vector<std::string> columns;
  for (const char* column : {"attempt", "solver", "since", "until"}) {
    columns.push_back(
        fmt::format("lease_{0} = CASE WHEN {1} THEN lease_{0} ELSE twin_{0} END", column, condition));
  }
  return fmt::format("{}", fmt::join(columns, ", "));
}

std::string placeholders(size_t first, size_t count) {
  std::vector<std::string> names;
  for (size_t i = 0; i < count; ++i) names.push_back(fmt::format("?{}", first + i));
  return fmt::format("({})", fmt::join(names, ", "));
}

// On table jobs: its tiles may be handed out to a solver that computes the values from ?`first` on.
std::string open_jobs(size_t first, size_t computes) {
  return fmt::format("held = 0 AND computes IN {}", placeholders(first, computes));
}

// On table tiles.
std::string is_free() {
  return fmt::format("{} AND lease_until <= :now AND twin_until <= :now", kOpen);
}

// Leased by one solver other than ?1, for longer than ?2.
constexpr char kSlow[] =
    "lease_attempt > 0 AND ("
    "(t.lease_until > :now AND t.twin_until <= :now AND t.lease_solver <> ?1 AND t.lease_since < :now - ?2) "
    "OR "
    "(t.twin_until > :now AND t.lease_until <= :now AND t.twin_solver <> ?1 AND t.twin_since < :now - ?2))";

SqlValues with(SqlValues values, std::span<const std::string> computes) {
  values.insert(values.end(), computes.begin(), computes.end());
  return values;
}

absl::StatusOr<bool> may_claim_ahead(SqlConnection& connection, std::span<const std::string> computes) {
  GW_ASSIGN_OR_RETURN(
      const SqlRows solvers,
      connection.run(
          fmt::format("SELECT count(*) FROM (SELECT lease_solver FROM tiles WHERE {0} AND lease_until > :now "
                      "UNION SELECT twin_solver FROM tiles WHERE {0} AND twin_until > :now) AS solvers",
                      kLeased),
          {}));
  // Job by job, so that each uses its part of the index.
  GW_ASSIGN_OR_RETURN(
      const SqlRows free,
      connection.run(
          fmt::format("SELECT coalesce(sum(free), 0) FROM (SELECT (SELECT count(*) FROM (SELECT 1 FROM "
                      "tiles WHERE job = jobs.id AND {} LIMIT ?1) AS enough) AS free FROM jobs WHERE {}) "
                      "AS each",
                      is_free(), open_jobs(2, computes.size())),
          with({solvers.integer(0, 0)}, computes)));
  return free.integer(0, 0) >= solvers.integer(0, 0);
}

// `next` selects the tile. Expired leases replaced by the claim count as lost.
absl::StatusOr<SqlRows> claim_free(SqlConnection& connection, const std::string& solver,
                                   std::int64_t lease_us, const std::string& next,
                                   std::span<const std::string> computes) {
  return connection.run(
      fmt::format(
          "UPDATE tiles SET lost = lost + CASE WHEN lease_attempt > 0 THEN 1 ELSE 0 END + "
          "CASE WHEN twin_attempt > 0 THEN 1 ELSE 0 END, attempts = attempts + 1, lease_attempt = attempts + "
          "1, lease_solver = ?1, "
          "lease_since = :now, lease_until = :now + ?2, twin_attempt = 0, twin_solver = '', twin_since = 0, "
          "twin_until = 0 WHERE (job, number) = ({}){}",
          next, kLeaseOfClaim),
      with({solver, lease_us}, computes));
}

// Quarantines a just claimed tile if all of its solvers fell silent: it may crash them.
absl::Status quarantine_lost(SqlConnection& connection, const SqlRows& claimed) {
  return connection
      .run(fmt::format("UPDATE tiles SET quarantined = 1, error = ?3, {} WHERE job = ?1 AND number = ?2",
                       kNoLease),
           {claimed.integer(0, 0), claimed.integer(0, 1),
            SqlBytes{fmt::format("{} solvers that had it fell silent", claimed.integer(0, 9))}})
      .status();
}

absl::StatusOr<SqlRows> claim_twice(SqlConnection& connection, const std::string& solver,
                                    const JobStoreOptions& options, std::span<const std::string> computes) {
  const std::int64_t min_us = std::chrono::microseconds(options.least_before_twice).count();
  GW_ASSIGN_OR_RETURN(
      const SqlRows jobs,
      connection.run(
          fmt::format(
              "SELECT j.id, (SELECT coalesce(avg(seconds), 0) FROM (SELECT seconds FROM tiles WHERE "
              "job = j.id AND {} ORDER BY done_at DESC LIMIT 100) AS last) FROM jobs j WHERE {} AND EXISTS "
              "(SELECT 1 FROM tiles t WHERE t.job = j.id AND {}) ORDER BY j.id",
              kDone, open_jobs(3, computes.size()), kSlow),
          with({solver, min_us}, computes)));
  for (size_t i = 0; i < jobs.size(); ++i) {
    const std::int64_t age_us = std::max(min_us, static_cast<std::int64_t>(jobs.real(i, 1) * 1e6));
    GW_ASSIGN_OR_RETURN(
        SqlRows claimed,
        connection.run(
            fmt::format(
                "UPDATE tiles SET {}, attempts = attempts + 1, twin_attempt = attempts + 1, twin_solver = "
                "?1, "
                "twin_since = :now, twin_until = :now + ?3 WHERE (job, number) = ("
                "SELECT t.job, t.number FROM tiles t WHERE t.job = ?4 AND {} "
                "ORDER BY CASE WHEN t.lease_until > t.twin_until THEN t.lease_since ELSE t.twin_since END, "
                "t.number "
                "LIMIT 1 :locking){}",
                first_lease_if("lease_until > twin_until"), kSlow, kLeaseOfClaim),
            {solver, age_us, std::chrono::microseconds(options.lease).count(), jobs.integer(i, 0)}));
    if (!claimed.empty()) return claimed;
  }
  return SqlRows();
}

// Ends the lease of attempt ?3; another lease stays.
std::string end_lease() {
  return first_lease_if("lease_attempt <> ?3") +
         ", twin_attempt = 0, twin_solver = '', twin_since = 0, twin_until = 0";
}

}  // namespace

absl::StatusOr<std::optional<Lease>> claim_tile(SqlConnection& connection, const std::string& solver,
                                                std::span<const std::string> computes, bool ahead,
                                                const JobStoreOptions& options, NextTile next_tile) {
  if (ahead) {
    GW_ASSIGN_OR_RETURN(const bool may, may_claim_ahead(connection, computes));
    if (!may) return std::nullopt;
  }
  SqlRows rows;
  do {
    if (!rows.empty()) GW_RETURN_IF_ERROR(quarantine_lost(connection, rows));
    GW_ASSIGN_OR_RETURN(rows, claim_free(connection, solver, std::chrono::microseconds(options.lease).count(),
                                         next_tile(open_jobs(3, computes.size()), is_free()), computes));
  } while (!rows.empty() && rows.integer(0, 9) >= kMaxLost);
  if (rows.empty() && !ahead) {
    GW_ASSIGN_OR_RETURN(rows, claim_twice(connection, solver, options, computes));
  }
  if (rows.empty()) return std::nullopt;
  return Lease{
      .id = {.job = rows.integer(0, 0),
             .tile = static_cast<int>(rows.integer(0, 1)),
             .attempt = static_cast<int>(rows.integer(0, 2))},
      .session = rows.text(0, 5),
      .work = rows.text(0, 6),
      .range = {.first = static_cast<int>(rows.integer(0, 3)), .count = static_cast<int>(rows.integer(0, 4))},
      .server_address = rows.text(0, 8),
      .own = rows.text(0, 7) == options.server_id};
}

absl::StatusOr<FailedAttempt> fail_attempt(SqlConnection& connection, const TileAttempt& lease,
                                           const std::string& error, bool permanent) {
  GW_ASSIGN_OR_RETURN(
      const SqlRows failed,
      connection.run(
          fmt::format("UPDATE tiles SET failures = failures + 1, error = ?4, quarantined = CASE WHEN "
                      "(?5 > 0 OR failures + 1 >= {}) AND NOT (lease_attempt <> ?3 AND lease_until > :now) "
                      "AND NOT (twin_attempt <> ?3 AND twin_until > :now) THEN 1 ELSE 0 END, {} "
                      "WHERE {} RETURNING quarantined",
                      kMaxAttempts, end_lease(), kAttempt),
          {lease.job, std::int64_t{lease.tile}, std::int64_t{lease.attempt}, SqlBytes{error},
           std::int64_t{permanent}}));
  if (failed.empty()) return FailedAttempt{};
  const bool quarantined = failed.integer(0, 0) != 0;
  // An expired lease may still be renewed.
  if (quarantined) {
    const std::string end_all = fmt::format("UPDATE tiles SET {} WHERE job = ?1 AND number = ?2", kNoLease);
    GW_RETURN_IF_ERROR(connection.run(end_all, {lease.job, std::int64_t{lease.tile}}).status());
  }
  return FailedAttempt{.had_lease = true, .quarantined = quarantined};
}

absl::StatusOr<bool> end_attempt(SqlConnection& connection, const TileAttempt& lease) {
  GW_ASSIGN_OR_RETURN(
      const SqlRows ended,
      connection.run(fmt::format("UPDATE tiles SET {} WHERE {} RETURNING number", end_lease(), kAttempt),
                     {lease.job, std::int64_t{lease.tile}, std::int64_t{lease.attempt}}));
  return !ended.empty();
}

}  // namespace glasswing
