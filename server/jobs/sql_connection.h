// Statements and rows, the same for both databases.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace glasswing {

struct SqlBytes {
  std::string bytes;
};
using SqlValue = std::variant<std::int64_t, double, std::string, SqlBytes>;
using SqlValues = std::vector<SqlValue>;

class SqlRows {
 public:
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  size_t size() const { return rows_.size(); }
  bool empty() const { return rows_.empty(); }
  const std::string& text(size_t row, size_t column) const { return rows_[row][column]; }
  std::int64_t integer(size_t row, size_t column) const;
  double real(size_t row, size_t column) const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

// Statements name their values ?1, ?2 ..., the time :now, and mark with :locking where rows that another
// change has locked are skipped.
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;
  virtual absl::StatusOr<SqlRows> run(const std::string& sql, const SqlValues& values) = 0;
};

class SqlReader {
 public:
  virtual ~SqlReader() = default;
  // Runs a statement that changes nothing.
  virtual absl::StatusOr<SqlRows> read(const std::string& sql, const SqlValues& values) = 0;
};

}  // namespace glasswing
