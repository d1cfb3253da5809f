#include "core/cli/amount.h"

#include <fmt/format.h>

#include <cmath>

namespace glasswing {

std::string bytes_text(double bytes) {
  if (bytes < 1e6) return fmt::format("{:.1f} kB", bytes / 1e3);
  if (bytes < 1e9) return fmt::format("{:.1f} MB", bytes / 1e6);
  return fmt::format("{:.1f} GB", bytes / 1e9);
}

std::string offset_text(double ns) {
  const double size = std::abs(ns);
  const char* sign = ns < 0.0 ? "-" : "";
  if (size < 999.5e3) return fmt::format("{}{:.3g} us", sign, size / 1e3);
  if (size < 999.5e6) return fmt::format("{}{:.3g} ms", sign, size / 1e6);
  if (size < 59.95e9) return fmt::format("{}{:.3g} s", sign, size / 1e9);
  const long long s = std::llround(size / 1e9);
  if (s < 3600) return fmt::format("{}{} min {} s", sign, s / 60, s % 60);
  if (s < 86400) return fmt::format("{}{} h {} min", sign, s / 3600, s % 3600 / 60);
  return fmt::format("{}{} d {} h", sign, s / 86400, s % 86400 / 3600);
}

}  // namespace glasswing
