#include "server/jobs/sqlite_job_store.h"

#include <absl/strings/str_replace.h>
#include <fmt/format.h>
#include <time.h>

#include <fstream>

#include "core/base/status.h"
#include "server/jobs/sql_text.h"

namespace glasswing {
namespace {

constexpr std::int64_t kSqliteSchemaVersion = 4;

std::string sqlite_schema() {
  return fmt::format(
      "DROP TABLE IF EXISTS tiles; DROP TABLE IF EXISTS jobs; DROP TABLE IF EXISTS servers; "
      "DROP TABLE IF EXISTS boot; "
      "CREATE TABLE boot (id TEXT NOT NULL); INSERT INTO boot VALUES (''); "
      "CREATE TABLE servers (id TEXT PRIMARY KEY, address TEXT NOT NULL); "
      "CREATE TABLE jobs (id INTEGER PRIMARY KEY AUTOINCREMENT, server TEXT NOT NULL, session TEXT NOT NULL, "
      "computes TEXT NOT NULL, work BLOB NOT NULL, held INTEGER NOT NULL DEFAULT 0, created INTEGER NOT "
      "NULL, "
      "survey_tile INTEGER NOT NULL DEFAULT 0, survey_attempt INTEGER NOT NULL DEFAULT 0, "
      "priority INTEGER NOT NULL DEFAULT 0, owner TEXT NOT NULL DEFAULT '', "
      "deadline INTEGER NOT NULL DEFAULT 0); "
      "CREATE TABLE tiles (job INTEGER NOT NULL REFERENCES jobs ON DELETE CASCADE, number INTEGER NOT NULL, "
      "first INTEGER NOT NULL, count INTEGER NOT NULL, attempts INTEGER NOT NULL, "
      "failures INTEGER NOT NULL DEFAULT 0, lost INTEGER NOT NULL DEFAULT 0, quarantined INTEGER NOT NULL "
      "DEFAULT 0, error BLOB NOT NULL "
      "DEFAULT '', "
      "lease_attempt INTEGER NOT NULL DEFAULT 0, lease_solver TEXT NOT NULL DEFAULT '', "
      "lease_since INTEGER NOT NULL DEFAULT 0, lease_until INTEGER NOT NULL DEFAULT 0, "
      "twin_attempt INTEGER NOT NULL DEFAULT 0, twin_solver TEXT NOT NULL DEFAULT '', "
      "twin_since INTEGER NOT NULL DEFAULT 0, twin_until INTEGER NOT NULL DEFAULT 0, "
      "done_attempt INTEGER NOT NULL DEFAULT 0, done_at INTEGER NOT NULL DEFAULT 0, result BLOB NOT NULL "
      "DEFAULT '', "
      "object_pixels INTEGER NOT NULL DEFAULT 0, flagged_pixels INTEGER NOT NULL DEFAULT 0, "
      "seconds REAL NOT NULL DEFAULT 0, unsolved_pixels INTEGER NOT NULL DEFAULT 0, PRIMARY KEY (job, "
      "number)) WITHOUT ROWID; "
      "CREATE INDEX tiles_open ON tiles (job, failures, number) WHERE {}; "
      "CREATE INDEX tiles_done ON tiles (job, done_at) WHERE {}; "
      "CREATE INDEX tiles_leased ON tiles (job, lease_since) WHERE {}; "
      "PRAGMA user_version = {}",
      kOpen, kDone, kLeased, kSqliteSchemaVersion);
}

std::int64_t now_us() {
  timespec now{};
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000;
}

std::string boot_id() {
  std::string id;
  std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), id);
  return id;
}

absl::StatusOr<SqlRows> run_in(Database& database, const std::string& sql, const SqlValues& values) {
  // SQLite has one writer, so no row is locked by another.
  Database::Query query =
      database.query(absl::StrReplaceAll(sql, {{":now", std::to_string(now_us())}, {":locking", ""}}));
  for (const SqlValue& value : values) {
    if (const auto* integer = std::get_if<std::int64_t>(&value)) query.bind(*integer);
    if (const auto* real = std::get_if<double>(&value)) query.bind(*real);
    if (const auto* text = std::get_if<std::string>(&value)) query.bind(std::string_view(*text));
    if (const auto* bytes = std::get_if<SqlBytes>(&value)) query.bind(std::string_view(bytes->bytes));
  }
  SqlRows rows;
  while (query.next()) {
    std::vector<std::string> row;
    for (int column = 0; column < query.columns(); ++column) row.push_back(query.text(column));
    rows.add(std::move(row));
  }
  GW_RETURN_IF_ERROR(query.status());
  return rows;
}

// Adds what tables of an earlier version lack.
absl::Status upgrade(Database& writer) {
  GW_ASSIGN_OR_RETURN(const SqlRows version, run_in(writer, "PRAGMA user_version", {}));
  const std::int64_t from = version.integer(0, 0);
  if (from == 0) return absl::OkStatus();  // there are none
  if (from < 2) {
    GW_RETURN_IF_ERROR(
        writer.run("ALTER TABLE tiles ADD COLUMN unsolved_pixels INTEGER NOT NULL DEFAULT 0; "
                   "PRAGMA user_version = 2"));
  }
  if (from < 3) {
    GW_RETURN_IF_ERROR(writer.run(fmt::format(
        "ALTER TABLE jobs ADD COLUMN priority INTEGER NOT NULL DEFAULT 0; "
        "ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT ''; "
        "DROP INDEX tiles_leased; CREATE INDEX tiles_leased ON tiles (job, lease_since) WHERE {}; "
        "PRAGMA user_version = 3",
        kLeased)));
  }
  if (from >= 4) return absl::OkStatus();
  return writer.run(
      "ALTER TABLE jobs ADD COLUMN deadline INTEGER NOT NULL DEFAULT 0; PRAGMA user_version = 4");
}

class Writer : public SqlConnection {
 public:
  explicit Writer(Database& database) : database_(database) {}
  absl::StatusOr<SqlRows> run(const std::string& sql, const SqlValues& values) override {
    return run_in(database_, sql, values);
  }

 private:
  Database& database_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteJobStore>> SqliteJobStore::open(const std::filesystem::path& path,
                                                                     JobStoreOptions options) {
  GW_ASSIGN_OR_RETURN(Database writer, Database::open(path));
  GW_ASSIGN_OR_RETURN(Database reader, Database::open(path));
  GW_RETURN_IF_ERROR(writer.check_structure());
  std::unique_ptr<SqliteJobStore> store(
      new SqliteJobStore(std::move(writer), std::move(reader), std::move(options)));
  GW_RETURN_IF_ERROR(store->transaction([&](SqlConnection&) { return store->prepare(); }));
  return store;
}

absl::StatusOr<std::unique_ptr<SqliteJobStore>> SqliteJobStore::open_in_memory(JobStoreOptions options) {
  GW_ASSIGN_OR_RETURN(Database writer, Database::open(":memory:"));
  std::unique_ptr<SqliteJobStore> store(
      new SqliteJobStore(std::move(writer), std::nullopt, std::move(options)));
  GW_RETURN_IF_ERROR(store->transaction([&](SqlConnection&) { return store->prepare(); }));
  return store;
}

absl::StatusOr<std::unique_ptr<SqliteJobStore>> SqliteJobStore::open_unclaimed(
    const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(Database writer, Database::open(path));
  GW_ASSIGN_OR_RETURN(Database reader, Database::open(path));
  GW_RETURN_IF_ERROR(upgrade(writer));
  return std::unique_ptr<SqliteJobStore>(new SqliteJobStore(std::move(writer), std::move(reader), {}));
}

absl::Status SqliteJobStore::prepare() {
  GW_RETURN_IF_ERROR(upgrade(writer_));
  GW_ASSIGN_OR_RETURN(const SqlRows version, run_in(writer_, "PRAGMA user_version", {}));
  if (version.integer(0, 0) > kSqliteSchemaVersion) {
    return absl::FailedPreconditionError(fmt::format(
        "jobs.sqlite is of version {}; this server knows version {}: update it, or move the file away",
        version.integer(0, 0), kSqliteSchemaVersion));
  }
  if (version.integer(0, 0) < kSqliteSchemaVersion) GW_RETURN_IF_ERROR(writer_.run(sqlite_schema()));
  const std::string boot = boot_id();
  GW_ASSIGN_OR_RETURN(
      const SqlRows same,
      run_in(writer_, "UPDATE boot SET id = ?1 WHERE id <> ?1 OR ?1 = '' RETURNING id", {boot}));
  if (!same.empty()) {
    // The machine was rebooted, and the clock restarted.
    GW_RETURN_IF_ERROR(run_in(writer_,
                              "UPDATE tiles SET lease_until = 0, twin_until = 0, lease_since = :now, "
                              "twin_since = :now, done_at = 0 WHERE lease_attempt > 0 OR done_at > 0",
                              {})
                           .status());
    GW_RETURN_IF_ERROR(run_in(writer_, "UPDATE jobs SET created = :now", {}).status());
  }
  GW_RETURN_IF_ERROR(run_in(writer_, "DELETE FROM servers", {}).status());
  GW_RETURN_IF_ERROR(
      run_in(writer_, "INSERT INTO servers VALUES (?1, ?2)", {options_.server_id, options_.server_address})
          .status());
  return run_in(writer_, "UPDATE jobs SET server = ?1, held = 0", {options_.server_id}).status();
}

absl::Status SqliteJobStore::transaction(Change change) {
  return commit({.change = change, .atomic = true, .is_done = false, .status = {}});
}
absl::Status SqliteJobStore::statements(Change change) {
  return commit({.change = change, .atomic = false, .is_done = false, .status = {}});
}

absl::Status SqliteJobStore::commit(Waiting waiting) {
  std::unique_lock lock(mutex_);
  waiting_.push_back(&waiting);
  committed_.wait(lock, [&] { return waiting.is_done || !is_committing_; });
  if (waiting.is_done) return waiting.status;
  is_committing_ = true;
  const std::vector<Waiting*> batch = std::move(waiting_);
  waiting_.clear();
  lock.unlock();
  commit_all(batch);
  lock.lock();
  for (Waiting* each : batch) each->is_done = true;
  is_committing_ = false;
  committed_.notify_all();
  return waiting.status;
}

void SqliteJobStore::commit_all(std::span<Waiting* const> batch) {
  Writer writer(writer_);
  absl::Status status = writer_.run("BEGIN IMMEDIATE");
  for (Waiting* each : batch) {
    if (!status.ok()) break;
    if (each->atomic) status = writer_.run("SAVEPOINT change");
    if (!status.ok()) break;
    each->status = each->change(writer);
    if (!each->atomic) continue;
    status = writer_.run(each->status.ok() ? "RELEASE change" : "ROLLBACK TO change; RELEASE change");
  }
  if (status.ok()) status = writer_.run("COMMIT");
  if (status.ok()) return;
  (void)writer_.run("ROLLBACK");
  for (Waiting* each : batch) each->status = status;
}

std::string SqliteJobStore::next_tile(const std::string& open, const std::string& free, bool rivals) const {
  if (!rivals) {
    return fmt::format(
        "SELECT t.job, t.number FROM jobs j CROSS JOIN tiles t WHERE {} AND t.job = j.id AND {} "
        "ORDER BY j.id, t.failures, t.number LIMIT 1",
        open, free);
  }
  return fmt::format(
      "{}SELECT j.id, f.number FROM (SELECT id, (SELECT number FROM tiles t WHERE t.job = jobs.id AND {} "
      "ORDER BY failures, number LIMIT 1) AS number FROM jobs WHERE {}) f JOIN {} WHERE j.id = f.id AND "
      "f.number IS NOT NULL ORDER BY {} LIMIT 1",
      served(), free, open, kJobsServed, job_order(options_));
}

absl::StatusOr<SqlRows> SqliteJobStore::read(const std::string& sql, const SqlValues& values) {
  const std::lock_guard lock(reader_mutex_);
  if (reader_) return run_in(*reader_, sql, values);
  absl::StatusOr<SqlRows> rows;
  (void)statements([&](SqlConnection& connection) { return (rows = connection.run(sql, values)).status(); });
  return rows;
}

}  // namespace glasswing
