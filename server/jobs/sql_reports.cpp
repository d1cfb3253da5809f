#include "server/jobs/sql_reports.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "server/jobs/sql_text.h"

namespace glasswing {
namespace {

constexpr char kTile[] =
    "SELECT number, first, count, failures, quarantined, error, result, object_pixels, flagged_pixels, "
    "seconds, unsolved_pixels "
    "FROM tiles WHERE job = ?1 ";

TileState tile_of(const SqlRows& rows, size_t row) {
  return {.number = static_cast<int>(rows.integer(row, 0)),
          .range = {.first = static_cast<int>(rows.integer(row, 1)),
                    .count = static_cast<int>(rows.integer(row, 2))},
          .failures = static_cast<int>(rows.integer(row, 3)),
          .quarantined = rows.integer(row, 4) != 0,
          .error = rows.text(row, 5),
          .done = {.result = rows.text(row, 6),
                   .object_pixels = rows.integer(row, 7),
                   .flagged_pixels = rows.integer(row, 8),
                   .unsolved_pixels = rows.integer(row, 10),
                   .seconds = rows.real(row, 9)}};
}

constexpr char kCounts[] =
    "count(*), count(CASE WHEN done_attempt > 0 THEN 1 END), coalesce(sum(quarantined), 0), "
    "count(CASE WHEN lease_until > :now OR twin_until > :now THEN 1 END), coalesce(sum(failures), 0), "
    "coalesce(sum(object_pixels), 0), coalesce(sum(flagged_pixels), 0), "
    "coalesce(sum(unsolved_pixels), 0)";

JobCounts counts_of(const SqlRows& rows, size_t row, size_t column) {
  const auto count = [&](size_t i) { return static_cast<int>(rows.integer(row, column + i)); };
  return {.tiles = count(0),
          .done = count(1),
          .quarantined = count(2),
          .leased = count(3),
          .failures = count(4),
          .object_pixels = rows.integer(row, column + 5),
          .flagged_pixels = rows.integer(row, column + 6),
          .unsolved_pixels = rows.integer(row, column + 7)};
}

// Selects the first or the second lease of each tile that has one.
std::string leases_in(const std::string& which, const std::string& other) {
  return fmt::format(
      "SELECT job, number, {0}_attempt AS attempt, (SELECT session FROM jobs WHERE id = job), {0}_solver, "
      "(SELECT server FROM jobs WHERE id = job), :now - {0}_since, "
      "CASE WHEN {1}_until > :now THEN 1 ELSE 0 END FROM tiles WHERE {2} AND {0}_until > :now",
      which, other, kLeased);
}

}  // namespace

absl::StatusOr<std::vector<std::int64_t>> report_jobs_of(SqlReader& reader, const std::string& server) {
  GW_ASSIGN_OR_RETURN(const SqlRows rows,
                      reader.read("SELECT id FROM jobs WHERE server = ?1 ORDER BY id", {server}));
  std::vector<std::int64_t> jobs;
  for (size_t i = 0; i < rows.size(); ++i) jobs.push_back(rows.integer(i, 0));
  return jobs;
}

absl::StatusOr<std::vector<TileState>> report_tiles(SqlReader& reader, std::int64_t job) {
  GW_ASSIGN_OR_RETURN(const SqlRows rows, reader.read(fmt::format("{}ORDER BY number", kTile), {job}));
  std::vector<TileState> tiles;
  for (size_t i = 0; i < rows.size(); ++i) tiles.push_back(tile_of(rows, i));
  return tiles;
}

absl::StatusOr<TileState> report_tile(SqlReader& reader, const TileAttempt& id) {
  GW_ASSIGN_OR_RETURN(const SqlRows rows,
                      reader.read(fmt::format("{}AND number = ?2", kTile), {id.job, std::int64_t{id.tile}}));
  if (rows.empty())
    return absl::AbortedError(fmt::format("there is no tile {} of a job {}", id.tile, id.job));
  return tile_of(rows, 0);
}

absl::StatusOr<JobCounts> report_counts(SqlReader& reader, std::int64_t job) {
  GW_ASSIGN_OR_RETURN(const SqlRows rows,
                      reader.read(fmt::format("SELECT {} FROM tiles WHERE job = ?1", kCounts), {job}));
  return counts_of(rows, 0, 0);
}

absl::StatusOr<std::vector<JobState>> report_jobs(SqlReader& reader, const std::string& own_server) {
  constexpr double kMinute_us = 60e6;
  GW_ASSIGN_OR_RETURN(
      const SqlRows rows,
      reader.read(
          fmt::format("SELECT j.id, j.session, j.computes, s.address, j.server, j.held, :now - j.created, "
                      "count(CASE WHEN done_attempt > 0 AND done_at > :now - 60000000 THEN 1 END), "
                      "j.priority, j.owner, j.deadline, coalesce(avg(CASE WHEN done_attempt > 0 THEN seconds "
                      "END), 0), {} "
                      "FROM jobs j JOIN servers s ON s.id = j.server JOIN tiles t ON t.job = j.id "
                      "WHERE EXISTS (SELECT 1 FROM tiles WHERE job = j.id AND {}) "
                      "GROUP BY j.id, j.session, j.computes, s.address, j.server, j.held, j.created, "
                      "j.priority, j.owner, j.deadline ORDER BY j.priority DESC, j.id",
                      kCounts, kOpen),
          {}));
  std::vector<JobState> jobs;
  for (size_t i = 0; i < rows.size(); ++i) {
    const double seen_us = std::clamp(rows.real(i, 6), 1e6, kMinute_us);
    jobs.push_back({.id = rows.integer(i, 0),
                    .priority = static_cast<JobClass>(rows.integer(i, 8)),
                    .deadline = rows.integer(i, 10) == 0 ? absl::InfiniteFuture()
                                                         : absl::FromUnixMicros(rows.integer(i, 10)),
                    .owner = rows.text(i, 9),
                    .session = rows.text(i, 1),
                    .computes = rows.text(i, 2),
                    .server_address = rows.text(i, 3),
                    .own = rows.text(i, 4) == own_server,
                    .suspended = rows.integer(i, 5) != 0,
                    .counts = counts_of(rows, i, 12),
                    .tiles_per_second = rows.real(i, 7) / seen_us * 1e6,
                    .tile_seconds = rows.real(i, 11)});
  }
  return jobs;
}

absl::StatusOr<std::vector<LeaseState>> report_leases(SqlReader& reader, const std::string& own_server) {
  GW_ASSIGN_OR_RETURN(const SqlRows rows, reader.read(leases_in("lease", "twin") + " UNION ALL " +
                                                          leases_in("twin", "lease") + " ORDER BY 1, 2, 3",
                                                      {}));
  std::vector<LeaseState> leases;
  for (size_t i = 0; i < rows.size(); ++i) {
    leases.push_back({.id = {.job = rows.integer(i, 0),
                             .tile = static_cast<int>(rows.integer(i, 1)),
                             .attempt = static_cast<int>(rows.integer(i, 2))},
                      .session = rows.text(i, 3),
                      .solver = rows.text(i, 4),
                      .own = rows.text(i, 5) == own_server,
                      .seconds = rows.real(i, 6) / 1e6,
                      .twice = rows.integer(i, 7) != 0});
  }
  return leases;
}

}  // namespace glasswing
