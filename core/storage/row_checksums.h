// What tells, of a table, rows that were altered, lost or slipped in: SQLite itself notices damage to a
// file's structure alone.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "core/storage/database.h"

namespace glasswing {

// Every row gets a checksum of `columns` (SQL, comma-separated), and the number of rows is kept, both by
// triggers. Rows of before are taken as they are.
absl::Status protect_rows(Database& database, const std::string& table, const std::string& columns);

// SQL that is true of a protected table's rows that are as they were written.
std::string row_sum_holds(const std::string& columns);
// Likewise, of whatever table; true of all rows where it was never protected.
absl::StatusOr<std::string> row_is_whole(Database& database, const std::string& table,
                                         const std::string& columns);

// DATA_LOSS: rows were altered, or there are more or fewer than were written; likewise.
absl::Status check_rows(Database& database, const std::string& table, const std::string& columns);
// The number of rows alone.
absl::Status check_row_count(Database& database, const std::string& table);

// Takes all rows as they are now.
absl::Status accept_rows(Database& database, const std::string& table, const std::string& columns);

}  // namespace glasswing
