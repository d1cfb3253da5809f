#include "server/catalogue.h"

#include <fmt/format.h>

#include "core/base/status.h"

namespace glasswing {
namespace {

absl::StatusOr<v1::Session> parsed(const std::string& bytes) {
  v1::Session session;
  if (!session.ParseFromString(bytes)) return absl::DataLossError("catalogue: a session cannot be read");
  return session;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Catalogue>> Catalogue::open(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(Database database, Database::open(path));
  GW_RETURN_IF_ERROR(database.run(
      "CREATE TABLE IF NOT EXISTS sessions (id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT UNIQUE NOT NULL, "
      "request_id TEXT NOT NULL, session BLOB NOT NULL)"));
  return std::unique_ptr<Catalogue>(new Catalogue(std::move(database)));
}

absl::Status Catalogue::insert(const v1::Session& session, const std::string& request_id) {
  const std::lock_guard lock(mutex_);
  const absl::Status status =
      database_.query("INSERT INTO sessions (name, request_id, session) VALUES (?, ?, ?)")
          .bind(session.name())
          .bind(request_id)
          .bind(session.SerializeAsString())
          .finish();
  if (absl::IsAlreadyExists(status)) {
    return absl::AlreadyExistsError(
        fmt::format("there is a session \"{}\" already; choose another name", session.name()));
  }
  return status;
}

absl::Status Catalogue::update(const v1::Session& session) {
  const std::lock_guard lock(mutex_);
  return database_.query("UPDATE sessions SET session = ? WHERE name = ?")
      .bind(session.SerializeAsString())
      .bind(session.name())
      .finish();
}

absl::Status Catalogue::remove(const std::string& name) {
  const std::lock_guard lock(mutex_);
  return database_.query("DELETE FROM sessions WHERE name = ?").bind(name).finish();
}

absl::StatusOr<v1::Session> Catalogue::first(Database::Query query, const std::string& missing) {
  if (query.next()) return parsed(query.text(0));
  GW_RETURN_IF_ERROR(query.status());
  return absl::NotFoundError(missing);
}

absl::StatusOr<v1::Session> Catalogue::find(const std::string& name) {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query("SELECT session FROM sessions WHERE name = ?");
  query.bind(name);
  return first(std::move(query),
               fmt::format("there is no session \"{}\"; `glasswing sessions` lists them", name));
}

absl::StatusOr<v1::Session> Catalogue::find_request(const std::string& request_id) {
  const std::lock_guard lock(mutex_);
  Database::Query query =
      database_.query("SELECT session FROM sessions WHERE request_id = ? AND request_id != ''");
  query.bind(request_id);
  return first(std::move(query), "no session was made by this request");
}

absl::StatusOr<std::vector<v1::Session>> Catalogue::list() {
  const std::lock_guard lock(mutex_);
  Database::Query query = database_.query("SELECT session FROM sessions ORDER BY id DESC");
  std::vector<v1::Session> sessions;
  while (query.next()) {
    GW_ASSIGN_OR_RETURN(v1::Session session, parsed(query.text(0)));
    sessions.push_back(std::move(session));
  }
  GW_RETURN_IF_ERROR(query.status());
  return sessions;
}

}  // namespace glasswing
