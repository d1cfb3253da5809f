#include "server/sessions/catalogue.h"

#include <absl/strings/ascii.h>
#include <absl/strings/escaping.h>
#include <absl/strings/numbers.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>
#include <absl/time/time.h>
#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/base/name.h"
#include "core/base/status.h"
#include "server/sessions/views.h"
#include "server/storage/row_checksums.h"

namespace glasswing {
namespace {

constexpr const char* kBeyondNames = "\x7f";                         // follows all characters of names
constexpr const char* kAfterSession = ", note, tags, copies, name";  // the columns that parsed() reads

std::string rows_of(const char* session_column) {
  return fmt::format("SELECT {}{}, {} FROM sessions ", session_column, kAfterSession,
                     row_sum_holds(kCatalogueColumns));
}

// A damaged record may have any bytes as its name.
std::string name_of(const Database::Query& row) {
  const std::string name = row.text(4);
  return check_name("session", name).ok() ? name : absl::CHexEscape(name.substr(0, 64));
}

// Adds the columns that catalogues of earlier versions lack.
absl::Status add_columns(Database& database) {
  for (const auto& [column, type] :
       {std::pair("note", "TEXT NOT NULL DEFAULT ''"), std::pair("tags", "TEXT NOT NULL DEFAULT ''"),
        std::pair("finished", "BLOB NOT NULL DEFAULT ''"), std::pair("copies", "BLOB NOT NULL DEFAULT ''")}) {
    Database::Query query = database.query("SELECT 1 FROM pragma_table_info('sessions') WHERE name = ?");
    query.bind(std::string_view(column));
    const bool is_there = query.next();
    GW_RETURN_IF_ERROR(query.finish());
    if (!is_there)
      GW_RETURN_IF_ERROR(database.run(fmt::format("ALTER TABLE sessions ADD COLUMN {} {}", column, type)));
  }
  return absl::OkStatus();
}

absl::StatusOr<absl::Time> time_of(const char* field, const std::string& text, absl::Time otherwise) {
  if (text.empty()) return otherwise;
  absl::Time time;
  std::string error;
  if (absl::ParseTime(absl::RFC3339_full, text, &time, &error)) return time;
  return absl::InvalidArgumentError(
      fmt::format("{} is \"{}\"; it must be a time such as 2026-11-01T12:00:00Z", field, text));
}

}  // namespace

absl::Status check_not_in_trash(const v1::Session& session) {
  if (session.deleted().empty()) return absl::OkStatus();
  return absl::NotFoundError(
      fmt::format("session \"{}\" is in the trash; take it back: glasswing undelete {}", session.name(),
                  capture_name(session)));
}

absl::Status name_taken(const v1::Session& session) {
  if (session.deleted().empty()) {
    return absl::AlreadyExistsError(
        fmt::format("session \"{}\" already exists; choose another name", capture_name(session)));
  }
  return absl::AlreadyExistsError(fmt::format(
      "session \"{0}\" is in the trash; choose another name, or give it up: glasswing delete {0} --now",
      capture_name(session)));
}

absl::StatusOr<bool> matches(const v1::Session& session, const v1::ListSessionsRequest& request) {
  GW_ASSIGN_OR_RETURN(const absl::Time from,
                      time_of("created_from", request.created_from(), absl::InfinitePast()));
  GW_ASSIGN_OR_RETURN(const absl::Time before,
                      time_of("created_before", request.created_before(), absl::InfiniteFuture()));
  GW_ASSIGN_OR_RETURN(const absl::Time created, time_of("created", session.created(), absl::InfinitePast()));
  const auto says = [wanted = absl::AsciiStrToLower(request.text())](const std::string& text) {
    return absl::AsciiStrToLower(text).find(wanted) != std::string::npos;
  };
  const bool text = request.text().empty() || says(session.name()) || says(session.note()) ||
                    says(session.reason()) || std::ranges::any_of(session.tags(), says);
  const bool tags = std::ranges::all_of(
      request.tags(), [&](const std::string& tag) { return std::ranges::count(session.tags(), tag) > 0; });
  const bool state =
      request.states().empty() || std::ranges::count(request.states(), static_cast<int>(session.state())) > 0;
  return text && tags && state && from <= created && created < before;
}

absl::StatusOr<v1::Session> Catalogue::parsed(const Database::Query& row) const {
  v1::Session session, copied;
  if (row.integer(5) == 0 || !session.ParseFromString(row.text(0)) || !copied.ParseFromString(row.text(3))) {
    return absl::DataLossError(fmt::format(
        "{}: the record of session \"{}\" is damaged; restore it from a backup, or stop the server and set "
        "the record aside: glasswing fsck --repair {}",
        path_.string(), name_of(row), path_.parent_path().string()));
  }
  session.set_note(row.text(1));
  const std::vector<std::string> tags = absl::StrSplit(row.text(2), ' ', absl::SkipEmpty());
  session.mutable_tags()->Assign(tags.begin(), tags.end());
  *session.mutable_copies() = copied.copies();
  return session;
}

v1::Session Catalogue::damaged(const Database::Query& row) const {
  v1::Session session;
  session.set_name(name_of(row));
  session.set_state(v1::SESSION_STATE_DAMAGED);
  session.set_reason(std::string(parsed(row).status().message()));
  return session;
}

absl::StatusOr<std::unique_ptr<Catalogue>> Catalogue::open(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(Database database, Database::open(path));
  GW_RETURN_IF_ERROR(database.run(
      "CREATE TABLE IF NOT EXISTS sessions (id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT UNIQUE NOT NULL, "
      "request_id TEXT NOT NULL, session BLOB NOT NULL)"));
  GW_RETURN_IF_ERROR(database.run(
      "CREATE TABLE IF NOT EXISTS qualities (session TEXT PRIMARY KEY, poor_fit REAL NOT NULL, error_px REAL "
      "NOT NULL, width_px REAL NOT NULL)"));
  GW_RETURN_IF_ERROR(add_columns(database));
  GW_RETURN_IF_ERROR(protect_rows(database, "sessions", kCatalogueColumns));
  absl::Status whole = database.check_structure();
  // An index only repeats the rows: it can be rebuilt.
  if (!whole.ok() && database.run("REINDEX").ok()) whole = database.check_structure();
  whole.Update(check_row_count(database, "sessions"));
  if (!whole.ok()) {
    return absl::DataLossError(fmt::format("{} is damaged: {}; glasswing fsck {} gives details",
                                           path.string(), std::string(whole.message()),
                                           path.parent_path().string()));
  }
  return std::unique_ptr<Catalogue>(new Catalogue(std::move(database), path));
}

absl::Status Catalogue::insert(const std::vector<v1::Session>& sessions, const std::string& request_id) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(database_.run("BEGIN"));
  for (const v1::Session& session : sessions) {
    const absl::Status status =
        database_.query("INSERT INTO sessions (name, request_id, session) VALUES (?, ?, ?)")
            .bind(session.name())
            .bind(request_id)
            .bind(session.SerializeAsString())
            .finish();
    if (status.ok()) continue;
    GW_RETURN_IF_ERROR(database_.run("ROLLBACK"));
    if (!absl::IsAlreadyExists(status)) return status;
    GW_ASSIGN_OR_RETURN(const v1::Session taken, find_locked(session.name()));
    return name_taken(taken);
  }
  const absl::Status committed = database_.run("COMMIT");
  if (!committed.ok()) (void)database_.run("ROLLBACK");
  return committed;
}

absl::Status Catalogue::update(const v1::Session& session) {
  const std::lock_guard lock(mutex_);
  return write(session);
}

absl::Status Catalogue::note(const v1::Session& session) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(database_.run("PRAGMA synchronous = NORMAL"));
  const absl::Status noted = write(session);
  GW_RETURN_IF_ERROR(database_.run("PRAGMA synchronous = FULL"));
  return noted;
}

absl::Status Catalogue::write(const v1::Session& session) {
  return database_.query("UPDATE sessions SET session = ? WHERE name = ?")
      .bind(session.SerializeAsString())
      .bind(session.name())
      .finish();
}

absl::StatusOr<v1::Session> Catalogue::annotate(const v1::AnnotateSessionRequest& request) {
  if (request.note().size() > kMaxNoteBytes) {
    return absl::InvalidArgumentError(
        fmt::format("the note has {} bytes; it must have at most {}", request.note().size(), kMaxNoteBytes));
  }
  for (const std::string& tag : request.add_tags()) GW_RETURN_IF_ERROR(check_name("tag", tag));
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(const v1::Session session, find_locked(request.name()));
  GW_RETURN_IF_ERROR(check_not_in_trash(session));
  std::set<std::string> tags(session.tags().begin(), session.tags().end());
  tags.insert(request.add_tags().begin(), request.add_tags().end());
  for (const std::string& tag : request.remove_tags()) tags.erase(tag);
  if (tags.size() > kMaxTags && request.add_tags_size() > 0) {
    return absl::ResourceExhaustedError(fmt::format(
        "session \"{}\" would have {} tags; it may have at most {}", request.name(), tags.size(), kMaxTags));
  }
  GW_RETURN_IF_ERROR(database_.query("UPDATE sessions SET note = ?, tags = ? WHERE name = ?")
                         .bind(request.has_note() ? request.note() : session.note())
                         .bind(absl::StrJoin(tags, " "))
                         .bind(request.name())
                         .finish());
  return find_locked(request.name());
}

absl::Status Catalogue::set_replica(const std::string& name, const v1::ArchiveCopy& copy) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::Session session, find_locked(name));
  for (v1::ArchiveCopy& known : *session.mutable_copies()) {
    if (known.node() != copy.node()) continue;
    known = copy;
    return store_replicas(session);
  }
  *session.add_copies() = copy;
  return store_replicas(session);
}

absl::Status Catalogue::drop_replica(const std::string& name, const std::string& node) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::Session session, find_locked(name));
  auto& copies = *session.mutable_copies();
  copies.erase(std::remove_if(copies.begin(), copies.end(),
                              [&](const v1::ArchiveCopy& copy) { return copy.node() == node; }),
               copies.end());
  return store_replicas(session);
}

absl::Status Catalogue::store_replicas(const v1::Session& session) {
  v1::Session alone;
  *alone.mutable_copies() = session.copies();
  return database_.query("UPDATE sessions SET copies = ? WHERE name = ?")
      .bind(alone.SerializeAsString())
      .bind(session.name())
      .finish();
}

absl::Status Catalogue::keep_finished(const v1::Session& session) {
  const std::lock_guard lock(mutex_);
  return database_.query("UPDATE sessions SET finished = ? WHERE name = ?")
      .bind(session.SerializeAsString())
      .bind(session.name())
      .finish();
}

absl::Status Catalogue::drop_finished(const std::string& name) {
  const std::lock_guard lock(mutex_);
  return database_.query("UPDATE sessions SET finished = '' WHERE name = ?").bind(name).finish();
}

absl::StatusOr<v1::Session> Catalogue::finished(const std::string& name) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(rows_of("finished") + "WHERE name = ? AND finished != ''");
  query.bind(name);
  return first(std::move(query), fmt::format("no solve of session \"{}\" has finished", name));
}

absl::Status Catalogue::remove(const std::string& name) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(database_.query("DELETE FROM qualities WHERE session = ?").bind(name).finish());
  return database_.query("DELETE FROM sessions WHERE name = ?").bind(name).finish();
}

absl::StatusOr<v1::Session> Catalogue::first(Database::Query query, const std::string& missing) {
  if (query.next()) return parsed(query);
  GW_RETURN_IF_ERROR(query.status());
  return absl::NotFoundError(missing);
}

absl::StatusOr<v1::Session> Catalogue::find_locked(const std::string& name) {
  Database::Query query = database_.query(rows_of("session") + "WHERE name = ?");
  query.bind(name);
  return first(std::move(query),
               fmt::format("there is no session \"{}\"; `glasswing sessions` lists them", name));
}

absl::StatusOr<v1::Session> Catalogue::find_anywhere(const std::string& name) {
  const std::lock_guard lock(mutex_);
  return find_locked(name);
}

absl::StatusOr<v1::Session> Catalogue::find(const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::Session session, find_anywhere(name));
  GW_RETURN_IF_ERROR(check_not_in_trash(session));
  return session;
}

absl::StatusOr<std::vector<v1::Session>> Catalogue::views_anywhere(const std::string& session) {
  const std::lock_guard lock(mutex_);
  // Names that begin with "session.": '/' follows '.'.
  Database::Query query = database_.query(rows_of("session") + "WHERE name > ? AND name < ? ORDER BY id");
  query.bind(session + ".").bind(session + "/");
  std::vector<v1::Session> views;
  while (query.next()) {
    absl::StatusOr<v1::Session> view = parsed(query);
    if (view.ok() && view->view_of() == session) views.push_back(*std::move(view));
  }
  GW_RETURN_IF_ERROR(query.status());
  return views;
}

absl::StatusOr<v1::Session> Catalogue::find_request(const std::string& request_id) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(rows_of("session") + "WHERE request_id = ? AND request_id != ''");
  query.bind(request_id);
  return first(std::move(query), "no session was made by this request");
}

absl::Status Catalogue::keep_quality(const std::string& name, const MatteQuality& quality) {
  const std::lock_guard lock(mutex_);
  return database_.query("INSERT OR REPLACE INTO qualities VALUES (?, ?, ?, ?)")
      .bind(name)
      .bind(quality.poor_fit)
      .bind(quality.error_px)
      .bind(quality.width_px)
      .finish();
}

absl::StatusOr<std::map<std::string, MatteQuality>> Catalogue::qualities(const std::string& begin) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(
      "SELECT session, poor_fit, error_px, width_px FROM qualities WHERE session >= ? AND session < ?");
  query.bind(begin).bind(begin + kBeyondNames);
  std::map<std::string, MatteQuality> qualities;
  while (query.next()) {
    MatteQuality& quality = qualities[query.text(0)];
    const bool read = absl::SimpleAtod(query.text(1), &quality.poor_fit) &&
                      absl::SimpleAtod(query.text(2), &quality.error_px) &&
                      absl::SimpleAtod(query.text(3), &quality.width_px);
    if (!read) qualities.erase(query.text(0));
  }
  GW_RETURN_IF_ERROR(query.status());
  return qualities;
}

absl::StatusOr<std::vector<v1::Session>> Catalogue::named(const std::string& begin) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(rows_of("session") + "WHERE name >= ? AND name < ?");
  query.bind(begin).bind(begin + kBeyondNames);
  std::vector<v1::Session> sessions;
  while (query.next()) {
    absl::StatusOr<v1::Session> session = parsed(query);
    if (session.ok() && session->deleted().empty()) sessions.push_back(*std::move(session));
  }
  GW_RETURN_IF_ERROR(query.status());
  return sessions;
}

absl::StatusOr<std::vector<v1::Session>> Catalogue::listed(bool in_trash) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query(rows_of("session") + "ORDER BY id DESC");
  std::vector<v1::Session> sessions;
  while (query.next()) {
    absl::StatusOr<v1::Session> session = parsed(query);
    if (session.ok() && session->deleted().empty() == in_trash) continue;
    if (session.ok() || !in_trash) sessions.push_back(session.ok() ? *std::move(session) : damaged(query));
  }
  GW_RETURN_IF_ERROR(query.status());
  return sessions;
}

}  // namespace glasswing
