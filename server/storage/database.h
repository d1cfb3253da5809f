// SQLite, kept durable: WAL with synchronous = FULL, so a committed change survives a power cut.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

struct sqlite3;
struct sqlite3_stmt;

namespace glasswing {

// One connection; its owner serialises access.
class Database {
 public:
  // SQL may use row_checksum(value, ...), a 64-bit hash of the values' bytes.
  static absl::StatusOr<Database> open(const std::filesystem::path& path);

  // DATA_LOSS: SQLite's own check finds the file's structure damaged.
  absl::Status check_structure();

  // Statements without results, separated by ';'.
  absl::Status run(const std::string& sql);

  // One statement with its values bound, read row by row.
  class Query {
   public:
    Query& bind(std::int64_t value);
    Query& bind(int value) { return bind(std::int64_t{value}); }
    Query& bind(double value);
    Query& bind(std::string_view value);  // text or bytes
    // Moves to the next row. False: no more rows, or the query failed (see status()).
    bool next();
    // Runs to the end, for statements without rows.
    absl::Status finish();
    const absl::Status& status() const { return status_; }
    int columns() const;
    std::int64_t integer(int column) const;
    std::string text(int column) const;

   private:
    friend class Database;
    struct Finalize {
      void operator()(sqlite3_stmt* statement) const;
    };
    std::unique_ptr<sqlite3_stmt, Finalize> statement_;
    sqlite3* connection_ = nullptr;
    int bound_ = 0;
    absl::Status status_;
  };
  Query query(const std::string& sql);
  // The number of rows that the last statement changed.
  int changed() const;

 private:
  struct Close {
    void operator()(sqlite3* connection) const;
  };
  std::unique_ptr<sqlite3, Close> connection_;
};

}  // namespace glasswing
