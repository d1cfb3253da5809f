#include "server/job_store.h"

#include <fmt/format.h>

#include <utility>

#include "core/base/status.h"

namespace glasswing {
namespace {

// Tiles were of rows only, once.
absl::Status rename_columns(Database& database) {
  for (const auto& [old, now] : {std::pair("first_row", "first"), std::pair("row_count", "count")}) {
    Database::Query query = database.query("SELECT 1 FROM pragma_table_info('tiles') WHERE name = ?");
    query.bind(std::string_view(old));
    const bool is_old = query.next();
    GW_RETURN_IF_ERROR(query.finish());
    if (is_old)
      GW_RETURN_IF_ERROR(database.run(fmt::format("ALTER TABLE tiles RENAME COLUMN {} TO {}", old, now)));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> JobStore::open(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(Database database, Database::open(path));
  // Leases of an earlier process ended with it; attempt numbers go on, so its solvers stay fenced.
  GW_RETURN_IF_ERROR(database.run(
      "CREATE TABLE IF NOT EXISTS tiles (id INTEGER PRIMARY KEY AUTOINCREMENT, session TEXT NOT NULL, "
      "number INTEGER NOT NULL, first INTEGER NOT NULL, count INTEGER NOT NULL, "
      "attempt INTEGER NOT NULL DEFAULT 0, failures INTEGER NOT NULL DEFAULT 0, "
      "lease_until INTEGER NOT NULL DEFAULT 0, solver TEXT NOT NULL DEFAULT '', result TEXT NOT NULL DEFAULT "
      "'', "
      "UNIQUE (session, number)); UPDATE tiles SET lease_until = 0; "
      "CREATE TEMP TABLE held (session TEXT PRIMARY KEY)"));
  GW_RETURN_IF_ERROR(rename_columns(database));
  return std::unique_ptr<JobStore>(new JobStore(std::move(database)));
}

absl::Status JobStore::create(const std::string& session, std::span<const int> counts) {
  std::vector<FrameRange> ranges;
  int first = 0;
  for (const int count : counts) {
    ranges.push_back({.first = first, .count = count});
    first += count;
  }
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(insert(session, ranges, "DELETE FROM tiles WHERE session = ?"));
  return database_.query("DELETE FROM held WHERE session = ?").bind(session).finish();
}

absl::Status JobStore::add(const std::string& session, std::span<const FrameRange> frames) {
  const std::lock_guard lock(mutex_);
  return insert(session, frames, "");
}

absl::Status JobStore::insert(const std::string& session, std::span<const FrameRange> ranges,
                              const std::string& before) {
  // Results of earlier solves must not be accepted: attempts go on from the highest one so far.
  Database::Query last = database_.query(
      "SELECT COALESCE(MAX(attempt) + 1, 0), COALESCE(MAX(number) + 1, 0) FROM tiles WHERE session = ?");
  last.bind(session);
  const bool known = last.next();
  const std::int64_t attempt = known ? last.integer(0) : 0;
  std::int64_t number = known && before.empty() ? last.integer(1) : 0;
  GW_RETURN_IF_ERROR(last.finish());
  GW_RETURN_IF_ERROR(database_.run("BEGIN IMMEDIATE"));
  absl::Status status;
  if (!before.empty()) status = database_.query(before).bind(session).finish();
  for (const FrameRange& range : ranges) {
    if (!status.ok()) break;
    status =
        database_.query("INSERT INTO tiles (session, number, first, count, attempt) VALUES (?, ?, ?, ?, ?)")
            .bind(session)
            .bind(number++)
            .bind(range.first)
            .bind(range.count)
            .bind(attempt)
            .finish();
  }
  if (!status.ok()) {
    (void)database_.run("ROLLBACK");
    return status;
  }
  return database_.run("COMMIT");
}

absl::Status JobStore::retry(const std::string& session) {
  const std::lock_guard lock(mutex_);
  return database_
      .query(
          "UPDATE tiles SET failures = 0, result = CASE result WHEN 'void' THEN '' ELSE result END "
          "WHERE session = ?")
      .bind(session)
      .finish();
}

absl::Status JobStore::hold(const std::string& session) {
  const std::lock_guard lock(mutex_);
  return database_.query("INSERT OR IGNORE INTO held VALUES (?)").bind(session).finish();
}

absl::Status JobStore::release(const std::string& session) {
  const std::lock_guard lock(mutex_);
  return database_.query("DELETE FROM held WHERE session = ?").bind(session).finish();
}

absl::Status JobStore::give_up(const std::string& session) {
  const std::lock_guard lock(mutex_);
  // They stay, done for good: a later solve counts its attempts on from theirs, and their late results are
  // refused.
  return database_.query("UPDATE tiles SET result = 'void', lease_until = 0 WHERE session = ?")
      .bind(session)
      .finish();
}

absl::Status JobStore::remove(const std::string& session) {
  GW_RETURN_IF_ERROR(give_up(session));
  const std::lock_guard lock(mutex_);
  return database_
      .query(
          "DELETE FROM tiles WHERE session = ? AND id != (SELECT id FROM tiles WHERE session = ? "
          "ORDER BY attempt DESC LIMIT 1)")
      .bind(session)
      .bind(session)
      .finish();
}

absl::StatusOr<std::optional<Tile>> JobStore::claim(const std::string& solver, nanoseconds now) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(
      "UPDATE tiles SET attempt = attempt + 1, solver = ?, lease_until = ? WHERE id = (SELECT id FROM tiles "
      "WHERE result = '' AND lease_until < ? AND session NOT IN (SELECT session FROM held) "
      "ORDER BY failures, id LIMIT 1) "
      "RETURNING session, number, first, count, attempt");
  query.bind(solver).bind((now + kLease).count()).bind(now.count());
  std::optional<Tile> tile;
  if (query.next()) {
    tile = Tile{.session = query.text(0),
                .number = static_cast<int>(query.integer(1)),
                .first = static_cast<int>(query.integer(2)),
                .count = static_cast<int>(query.integer(3)),
                .attempt = static_cast<int>(query.integer(4)),
                .result = ""};
  }
  GW_RETURN_IF_ERROR(query.finish());
  return tile;
}

absl::Status JobStore::fenced(const Tile& lease) {
  if (database_.changed() == 1) return absl::OkStatus();
  return absl::AbortedError(fmt::format("attempt {} at tile {} of session \"{}\" is void: the lease was lost",
                                        lease.attempt, lease.number, lease.session));
}

absl::Status JobStore::keep(const Tile& lease, nanoseconds now) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(
      database_
          .query("UPDATE tiles SET lease_until = ? WHERE session = ? AND number = ? AND attempt = ? "
                 "AND result = ''")
          .bind((now + kLease).count())
          .bind(lease.session)
          .bind(lease.number)
          .bind(lease.attempt)
          .finish());
  return fenced(lease);
}

absl::Status JobStore::complete(const Tile& lease, const std::string& result) {
  const std::lock_guard lock(mutex_);
  // The same attempt may say it twice: its first answer may have been lost on the way.
  GW_RETURN_IF_ERROR(
      database_
          .query("UPDATE tiles SET result = ?, lease_until = 0 WHERE session = ? AND number = ? AND "
                 "attempt = ? AND result IN ('', ?)")
          .bind(result)
          .bind(lease.session)
          .bind(lease.number)
          .bind(lease.attempt)
          .bind(result)
          .finish());
  return fenced(lease);
}

absl::StatusOr<bool> JobStore::fail(const Tile& lease) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(
      "UPDATE tiles SET failures = failures + 1, lease_until = 0 WHERE session = ? AND number = ? AND "
      "attempt = ? "
      "AND result = '' RETURNING failures");
  query.bind(lease.session).bind(lease.number).bind(lease.attempt);
  const bool had = query.next();
  const bool exhausted = had && query.integer(0) >= kMaxAttempts;
  GW_RETURN_IF_ERROR(query.finish());
  return exhausted;
}

absl::StatusOr<std::vector<Tile>> JobStore::tiles(const std::string& session) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(
      "SELECT number, first, count, attempt, result FROM tiles WHERE session = ? ORDER BY number");
  query.bind(session);
  std::vector<Tile> tiles;
  while (query.next()) {
    tiles.push_back({.session = session,
                     .number = static_cast<int>(query.integer(0)),
                     .first = static_cast<int>(query.integer(1)),
                     .count = static_cast<int>(query.integer(2)),
                     .attempt = static_cast<int>(query.integer(3)),
                     .result = query.text(4)});
  }
  GW_RETURN_IF_ERROR(query.status());
  return tiles;
}

}  // namespace glasswing
