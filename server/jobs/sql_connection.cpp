#include "server/jobs/sql_connection.h"

#include <cstdlib>

namespace glasswing {

std::int64_t SqlRows::integer(size_t row, size_t column) const {
  return std::strtoll(text(row, column).c_str(), nullptr, 10);
}
double SqlRows::real(size_t row, size_t column) const {
  return std::strtod(text(row, column).c_str(), nullptr);
}

}  // namespace glasswing
