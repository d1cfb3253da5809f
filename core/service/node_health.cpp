#include "core/service/node_health.h"

#include <algorithm>
#include <fstream>
#include <system_error>

namespace glasswing {

namespace fs = std::filesystem;

v1::NodeHealth node_health(const fs::path& data, const fs::path& sensors) {
  v1::NodeHealth health;
  std::error_code error;
  if (!data.empty()) {
    const fs::space_info space = fs::space(data, error);
    if (!error) {
      health.set_free_bytes(static_cast<std::int64_t>(space.available));
      health.set_total_bytes(static_cast<std::int64_t>(space.capacity));
    }
  }
  for (const fs::directory_entry& chip : fs::directory_iterator(sensors, error)) {
    for (int number = 1; number <= 32; ++number) {
      std::ifstream in(chip.path() / ("temp" + std::to_string(number) + "_input"));
      double millidegrees = 0.0;
      if (!(in >> millidegrees)) continue;
      health.set_temperature_c(health.has_temperature_c()
                                   ? std::max(health.temperature_c(), 1e-3 * millidegrees)
                                   : 1e-3 * millidegrees);
    }
  }
  return health;
}

}  // namespace glasswing
