#include "server/storage/row_checksums.h"

#include <fmt/format.h>

#include "core/base/status.h"

namespace glasswing {
namespace {

absl::StatusOr<bool> exists(Database& database, const std::string& sql) {
  Database::Query query = database.query(sql);
  const bool found = query.next();
  GW_RETURN_IF_ERROR(query.status());
  return found;
}

absl::StatusOr<bool> is_protected(Database& database, const std::string& table) {
  return exists(database, fmt::format("SELECT 1 FROM pragma_table_info('{}') WHERE name = 'row_sum'", table));
}

}  // namespace

std::string row_sum_holds(const std::string& columns) {
  return fmt::format("row_sum = row_checksum({})", columns);
}

absl::StatusOr<std::string> row_is_whole(Database& database, const std::string& table,
                                         const std::string& columns) {
  GW_ASSIGN_OR_RETURN(const bool is_there, is_protected(database, table));
  return is_there ? row_sum_holds(columns) : "1";
}

absl::Status accept_rows(Database& database, const std::string& table, const std::string& columns) {
  return database.run(
      fmt::format("BEGIN IMMEDIATE; UPDATE {0} SET row_sum = row_checksum({1}); "
                  "INSERT OR REPLACE INTO row_counts (name, count) SELECT '{0}', count(*) FROM {0}; COMMIT",
                  table, columns));
}

absl::Status protect_rows(Database& database, const std::string& table, const std::string& columns) {
  GW_ASSIGN_OR_RETURN(const bool is_there, is_protected(database, table));
  if (is_there) return absl::OkStatus();
  // All or nothing: half of it would look like damage.
  return database.run(
      fmt::format("BEGIN IMMEDIATE; "
                  "ALTER TABLE {0} ADD COLUMN row_sum INTEGER NOT NULL DEFAULT 0; "
                  "CREATE TABLE IF NOT EXISTS row_counts (name TEXT PRIMARY KEY, count INTEGER NOT NULL); "
                  "INSERT OR REPLACE INTO row_counts (name, count) SELECT '{0}', count(*) FROM {0}; "
                  "UPDATE {0} SET row_sum = row_checksum({1}); "
                  "CREATE TRIGGER {0}_inserted AFTER INSERT ON {0} BEGIN "
                  "UPDATE {0} SET row_sum = row_checksum({1}) WHERE rowid = NEW.rowid; "
                  "UPDATE row_counts SET count = count + 1 WHERE name = '{0}'; END; "
                  "CREATE TRIGGER {0}_updated AFTER UPDATE OF {1} ON {0} BEGIN "
                  "UPDATE {0} SET row_sum = row_checksum({1}) WHERE rowid = NEW.rowid; END; "
                  "CREATE TRIGGER {0}_deleted AFTER DELETE ON {0} BEGIN "
                  "UPDATE row_counts SET count = count - 1 WHERE name = '{0}'; END; COMMIT",
                  table, columns));
}

absl::Status check_row_count(Database& database, const std::string& table) {
  GW_ASSIGN_OR_RETURN(const bool is_there, is_protected(database, table));
  if (!is_there) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(
      const bool counted,
      exists(database,
             fmt::format("SELECT 1 FROM row_counts WHERE name = '{0}' AND count = (SELECT count(*) FROM {0})",
                         table)));
  if (counted) return absl::OkStatus();
  return absl::DataLossError(fmt::format("{} has more or fewer rows than were written", table));
}

absl::Status check_rows(Database& database, const std::string& table, const std::string& columns) {
  GW_ASSIGN_OR_RETURN(const std::string whole, row_is_whole(database, table, columns));
  GW_ASSIGN_OR_RETURN(const bool altered,
                      exists(database, fmt::format("SELECT 1 FROM {} WHERE NOT ({})", table, whole)));
  if (altered)
    return absl::DataLossError(fmt::format("rows of {} were altered after they were written", table));
  return check_row_count(database, table);
}

}  // namespace glasswing
