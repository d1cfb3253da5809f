#include "server/storage/database.h"

#include <fmt/format.h>
#include <sqlite3.h>
#include <unistd.h>

#include "core/base/checksum.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

absl::Status error_of(sqlite3* connection) {
  const std::filesystem::path file = sqlite3_db_filename(connection, "main");
  const std::string message = fmt::format("{}: {}", file.filename().string(), sqlite3_errmsg(connection));
  switch (sqlite3_errcode(connection)) {
    case SQLITE_FULL:
      return absl::ResourceExhaustedError(message);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
    case SQLITE_ERROR:  // our SQL is right, so the tables are not those that we created
      return absl::DataLossError(message);
    case SQLITE_READONLY:  // a format of the future, unless the file is read-only
      return ::access(file.c_str(), W_OK) == 0 ? absl::DataLossError(message) : absl::InternalError(message);
    case SQLITE_CONSTRAINT:
      return absl::AlreadyExistsError(message);
    default:
      return absl::InternalError(message);
  }
}

// row_checksum(a, b, ...): of the values' bytes, each after its length.
void row_checksum(sqlite3_context* context, int count, sqlite3_value** values) {
  RunningChecksum sum;
  for (int i = 0; i < count; ++i) {
    const void* value = sqlite3_value_blob(values[i]);
    const size_t size = sqlite3_value_bytes(values[i]);
    sum.add(fmt::format("{}:", size));
    if (size > 0) sum.add({static_cast<const char*>(value), size});
  }
  sqlite3_result_int64(context, static_cast<sqlite3_int64>(sum.value()));
}

}  // namespace

void Database::Close::operator()(sqlite3* connection) const {
  sqlite3_close_v2(connection);
}
void Database::Query::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

absl::StatusOr<Database> Database::open(const std::filesystem::path& path) {
  Database database;
  sqlite3* connection = nullptr;
  const int result = sqlite3_open(path.c_str(), &connection);
  database.connection_.reset(connection);
  if (result != SQLITE_OK) {
    return absl::UnavailableError(
        fmt::format("cannot open {}: {}", path.string(), sqlite3_errmsg(connection)));
  }
  sqlite3_busy_timeout(connection, 5000);
  sqlite3_create_function(connection, "row_checksum", -1,
                          SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS, nullptr, row_checksum,
                          nullptr, nullptr);
  GW_RETURN_IF_ERROR(
      database.run("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON"));
  return database;
}

absl::Status Database::run(const std::string& sql) {
  if (sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK) {
    return absl::OkStatus();
  }
  return error_of(connection_.get());
}

absl::Status Database::check_structure() {
  Query check = query("PRAGMA integrity_check");
  if (check.next() && check.text(0) != "ok") {
    // Several lines, the first of which names the database.
    const std::string found = check.text(0);
    const size_t first = found.starts_with("***") ? found.find('\n') + 1 : 0;
    return absl::DataLossError(found.substr(first, found.find('\n', first) - first));
  }
  return check.status();
}

Database::Query Database::query(const std::string& sql) {
  Query query;
  query.connection_ = connection_.get();
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(connection_.get(), sql.c_str(), -1, &statement, nullptr) != SQLITE_OK) {
    query.status_ = error_of(connection_.get());
  }
  query.statement_.reset(statement);
  return query;
}

int Database::changed() const {
  return sqlite3_changes(connection_.get());
}

Database::Query& Database::Query::bind(std::int64_t value) {
  sqlite3_bind_int64(statement_.get(), ++bound_, value);
  return *this;
}

Database::Query& Database::Query::bind(double value) {
  sqlite3_bind_double(statement_.get(), ++bound_, value);
  return *this;
}

Database::Query& Database::Query::bind(std::string_view value) {
  sqlite3_bind_text64(statement_.get(), ++bound_, value.data(), value.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  return *this;
}

bool Database::Query::next() {
  if (!status_.ok()) return false;
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  if (result != SQLITE_DONE) status_ = error_of(connection_);
  return false;
}

absl::Status Database::Query::finish() {
  while (next()) {
  }
  return status_;
}

int Database::Query::columns() const {
  return sqlite3_column_count(statement_.get());
}

std::int64_t Database::Query::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string Database::Query::text(int column) const {
  const void* bytes = sqlite3_column_blob(statement_.get(), column);
  const size_t size = sqlite3_column_bytes(statement_.get(), column);
  return bytes == nullptr ? std::string() : std::string(static_cast<const char*>(bytes), size);
}

}  // namespace glasswing
