// Checksums that reveal altered, lost or inserted rows of a table: SQLite itself notices only damage to the
// structure of its file.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "server/storage/database.h"

namespace glasswing {

// Triggers maintain a checksum of `columns` (SQL, comma-separated) in every row, and the number of rows.
// Existing rows are accepted as they are.
absl::Status protect_rows(Database& database, const std::string& table, const std::string& columns);

// An SQL condition that holds for the unaltered rows of a protected table.
std::string row_sum_holds(const std::string& columns);
// The same for any table; it holds for all rows of one that was never protected.
absl::StatusOr<std::string> row_is_whole(Database& database, const std::string& table,
                                         const std::string& columns);

// DATA_LOSS: rows were altered, or there are more or fewer than were written. OK for a table that was never
// protected.
absl::Status check_rows(Database& database, const std::string& table, const std::string& columns);
// The same for the number of rows alone.
absl::Status check_row_count(Database& database, const std::string& table);

// The columns of the catalogue's table `sessions`, whose rows are protected.
inline constexpr char kCatalogueColumns[] = "id, name, request_id, session, note, tags, finished, copies";

// The file of the console's tokens and logins below the server's data, and its protected tables' columns.
inline constexpr char kTokensFile[] = "console.sqlite";
inline constexpr char kTokenColumns[] = "id, hash, name, role, made_by, parent, expires";
inline constexpr char kLoginColumns[] = "hash, token";

// The same of the queue of captures.
inline constexpr char kQueueFile[] = "queue.sqlite";
inline constexpr char kQueueColumns[] = "number, place, request_id, item";

// Accepts all rows as they are now.
absl::Status accept_rows(Database& database, const std::string& table, const std::string& columns);

}  // namespace glasswing
