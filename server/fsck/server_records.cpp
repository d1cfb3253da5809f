#include "server/fsck/server_records.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "server/jobs/sqlite_job_store.h"
#include "server/storage/row_checksums.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr char kCatalogue[] = "catalogue.sqlite", kJobs[] = "jobs.sqlite";

bool is_being_solved(const v1::Session& session) {
  return session.job() != 0 &&
         (session.state() == v1::SESSION_STATE_SOLVING || session.state() == v1::SESSION_STATE_PAUSED ||
          session.state() == v1::SESSION_STATE_FAILED);
}

}  // namespace

std::optional<Database> ServerRecords::open_database(const char* name, Finding finding, Check& check) {
  const fs::path file = data_ / name;
  if (!fs::exists(file)) return std::nullopt;
  absl::StatusOr<std::string> bytes = check.read(file);
  absl::StatusOr<Database> database = bytes.ok() ? Database::open(file) : bytes.status();
  const absl::Status status = database.ok() ? database->check_structure() : database.status();
  if (status.ok()) return *std::move(database);
  database = status;  // closed before it is moved
  finding.file = file.string();
  finding.what = std::string(status.message());
  check.found(std::move(finding), [&]() -> absl::Status {
    for (const char* part : {"", "-wal", "-shm"}) {
      const fs::path path = file.string() + part;
      if (fs::exists(path)) GW_RETURN_IF_ERROR(set_aside(data_, path));
    }
    return absl::OkStatus();
  });
  return std::nullopt;
}

void ServerRecords::open(Check& check) {
  catalogue_ = open_database(
      kCatalogue,
      {.file = "",
       .what = "",
       .meaning = "the server does not know its sessions: restore the file from a backup; frames and mattes "
                  "are stored separately and checked by themselves",
       .repair = ""},
      check);
  open_jobs(check);
  if (catalogue_) read_sessions(check);
  (void)open_database(kQueueFile,
                      {.file = "",
                       .what = "",
                       .meaning = "the captures that wait in the queue are lost",
                       .repair = "it is set aside; add them again: glasswing queue add"},
                      check);
  (void)open_database(kTokensFile,
                      {.file = "",
                       .what = "",
                       .meaning = "the console's tokens and logins are lost",
                       .repair = "it is set aside; browsers must log in again, with new tokens"},
                      check);
}

void ServerRecords::open_jobs(Check& check) {
  const bool is_sound = open_database(kJobs,
                                      {.file = "",
                                       .what = "",
                                       .meaning = "solves in progress are lost, and must be requested again",
                                       .repair = "it is set aside, and the server creates a new one"},
                                      check)
                            .has_value();
  if (!is_sound) return;
  absl::StatusOr<std::unique_ptr<SqliteJobStore>> jobs = SqliteJobStore::open_unclaimed(data_ / kJobs);
  if (jobs.ok()) jobs_ = *std::move(jobs);
}

void ServerRecords::read_sessions(Check& check) {
  std::vector<std::string> bad;
  const absl::StatusOr<std::string> whole = row_is_whole(*catalogue_, "sessions", kCatalogueColumns);
  Database::Query query = catalogue_->query(
      fmt::format("SELECT name, session, finished, copies, {} FROM sessions", whole.value_or("1")));
  while (query.next()) {
    const std::string name = query.text(0), finished = query.text(2);
    names_.insert(name);
    SessionRecord record;
    v1::Session before, copies;
    const bool good = query.integer(4) != 0 && record.session.ParseFromString(query.text(1)) &&
                      record.session.name() == name && check_name("session", name).ok() &&
                      before.ParseFromString(finished) && copies.ParseFromString(query.text(3));
    if (!good) bad.push_back(name);
    if (!finished.empty()) record.finished = std::move(before);
    if (good) sessions_.push_back(std::move(record));
  }
  if (const absl::Status status = query.status(); !status.ok()) {
    check.found({.file = (data_ / kCatalogue).string(),
                 .what = std::string(status.message()),
                 .meaning = "not all sessions can be read: restore the file from a backup",
                 .repair = ""});
  }
  if (const absl::Status count = check_row_count(*catalogue_, "sessions"); !count.ok()) {
    check.found({.file = (data_ / kCatalogue).string(),
                 .what = std::string(count.message()),
                 .meaning = "the server does not start. A session's record may be lost: restore it from a "
                            "backup; its frames "
                            "are not touched, and glasswing import of their archive makes a session again",
                 .repair = "the existing records are accepted as complete"},
                [&] { return accept_rows(*catalogue_, "sessions", kCatalogueColumns); });
  }
  for (const std::string& name : bad) {
    check.found(
        {.file = (data_ / kCatalogue).string(),
         .what = fmt::format("the record of session \"{}\" cannot be read", name),
         .meaning = "the session cannot be used; restore its record from a backup. Its frames are not "
                    "touched: glasswing import of their archive makes a session again",
         .repair = "its bytes are set aside, and the record is removed"},
        [&]() -> absl::Status {
          Database::Query row = catalogue_->query(
              "SELECT quote(session), quote(finished), quote(copies), quote(note), "
              "quote(tags) FROM sessions WHERE name = ?");
          row.bind(name);
          std::string kept = name + "\n";
          while (row.next())
            for (int column = 0; column < row.columns(); ++column) kept += row.text(column) + "\n";
          GW_RETURN_IF_ERROR(row.status());
          const fs::path aside = data_ / kDamagedDirectory / "sessions";
          GW_RETURN_IF_ERROR(make_directory_durably(aside));
          const std::string file = check_name("session", name).ok() ? name : random_token();
          GW_RETURN_IF_ERROR(write_file_durably(aside / file, kept));
          return catalogue_->query("DELETE FROM sessions WHERE name = ?").bind(name).finish();
        });
  }
}

bool ServerRecords::knows(const std::string& session) const {
  return !catalogue_ || names_.contains(session);
}

std::vector<TileRecord> ServerRecords::tiles_of_solves() {
  std::vector<TileRecord> records;
  if (jobs_ == nullptr) return records;
  for (const SessionRecord& record : sessions_) {
    if (!is_being_solved(record.session)) continue;
    const std::int64_t job = record.session.job();
    const absl::StatusOr<std::vector<TileState>> tiles = jobs_->tiles(job);
    if (!tiles.ok()) continue;  // tables of another version hold nothing of ours
    for (const TileState& tile : *tiles) {
      if (!tile.done.result.ends_with(".exr")) continue;  // a survey, or a video's frames, has no file here
      records.push_back(
          {.session = record.session.name(), .job = job, .number = tile.number, .result = tile.done.result});
    }
  }
  return records;
}

absl::Status ServerRecords::update(const SessionRecord& record) {
  return catalogue_->query("UPDATE sessions SET session = ?, finished = ? WHERE name = ?")
      .bind(record.session.SerializeAsString())
      .bind(record.finished ? record.finished->SerializeAsString() : std::string())
      .bind(record.session.name())
      .finish();
}

absl::Status ServerRecords::queue_again(const TileRecord& tile) {
  return jobs_->requeue(tile.job, tile.number);
}

absl::Status ServerRecords::queue_again(std::int64_t job, int frame) {
  if (jobs_ == nullptr) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, jobs_->tiles(job));
  for (const TileState& tile : tiles) {
    const bool covers = tile.range.first <= frame && frame < tile.range.first + tile.range.count;
    if (covers && tile.is_done()) GW_RETURN_IF_ERROR(jobs_->requeue(job, tile.number));
  }
  return absl::OkStatus();
}

}  // namespace glasswing
