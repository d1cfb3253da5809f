#include "client/live/live_figures.h"

#include <fmt/format.h>

#include <algorithm>

namespace glasswing {
namespace {

double ms(nanoseconds time) {
  return 1e-6 * static_cast<double>(time.count());
}

struct Spread {
  double median = 0.0, p95 = 0.0, worst = 0.0;
};
Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const auto at = [&](double share) {
    return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
  };
  return {.median = at(0.5), .p95 = at(0.95), .worst = values.back()};
}
nlohmann::json json_of(const std::vector<double>& values) {
  const Spread spread = spread_of(values);
  return {{"median", spread.median}, {"p95", spread.p95}, {"worst", spread.worst}};
}

}  // namespace

void LiveFigures::add(const v1::LiveFrame& frame, ClockReading exposure_start, ClockReading exposure_end,
                      nanoseconds shown) {
  if (from_middle_ms_.empty()) {
    first_ = shown;
    passed_over_before_ = frame.frames_passed_over();
  }
  last_ = shown;
  from_start_ms_.push_back(ms(shown - exposure_start.time));
  from_middle_ms_.push_back(ms(shown - (exposure_start.time + exposure_end.time) / 2));
  solve_ms_.push_back(frame.solve_ms());
  clock_error_ms_ = std::max(clock_error_ms_, ms(std::max(exposure_start.error, exposure_end.error)));
  newest_ = frame;
  newest_.clear_picture();
}

double LiveFigures::frames_per_second() const {
  if (last_ <= first_) return 0.0;
  return 1000.0 * static_cast<double>(frames() - 1) / ms(last_ - first_);
}

std::string LiveFigures::line() const {
  const Spread latency = spread_of(from_middle_ms_);
  return fmt::format(
      "{} frames, {:.1f} a second; latency {:.0f} ms (95 %: {:.0f}, worst {:.0f}) from the exposure's "
      "middle; "
      "{} skipped; {} px of the object, {} flagged",
      frames(), frames_per_second(), latency.median, latency.p95, latency.worst,
      newest_.frames_passed_over() - passed_over_before_, newest_.object_pixel_count(),
      newest_.flagged_pixel_count());
}

nlohmann::json LiveFigures::json() const {
  return {{"frames", frames()},
          {"width_px", newest_.taken().width_px()},
          {"height_px", newest_.taken().height_px()},
          {"frames_per_second", frames_per_second()},
          {"latency_ms", json_of(from_middle_ms_)},
          {"latency_from_start_ms", json_of(from_start_ms_)},
          {"solve_ms", json_of(solve_ms_)},
          {"clock_error_ms", clock_error_ms_},
          {"frames_passed_over", newest_.frames_passed_over() - passed_over_before_},
          {"object_pixel_count", newest_.object_pixel_count()},
          {"flagged_pixel_count", newest_.flagged_pixel_count()}};
}

}  // namespace glasswing
