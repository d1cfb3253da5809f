#include "server/queue/queue_wish.h"

#include <absl/strings/str_replace.h>
#include <fmt/format.h>

#include <cmath>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/pattern/plan.h"

namespace glasswing {
namespace {

constexpr char kItem[] = "{item}";

absl::Status check_range(const char* field, double value, double high) {
  if (value >= 0.0 && value <= high) return absl::OkStatus();  // false for NaN
  return absl::InvalidArgumentError(fmt::format("{} is {}; it must be 0 to {}", field, value, high));
}

absl::Status check_time(const char* field, const std::string& text) {
  absl::Time time;
  if (text.empty() || absl::ParseTime(absl::RFC3339_full, text, &time, nullptr)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{} is \"{}\"; it must be a time such as 2026-11-01T20:00:00Z", field, text));
}

}  // namespace

absl::Time earliest_start(const v1::QueueWish& wish) {
  absl::Time time = absl::InfinitePast();
  if (!wish.not_before().empty())
    (void)absl::ParseTime(absl::RFC3339_full, wish.not_before(), &time, nullptr);
  return time;
}

std::set<std::string> images_of(const v1::QueueWish& wish) {
  std::set<std::string> images;
  for (const v1::Photo& photo : wish.plan().photos()) images.insert(photo.file());
  for (const auto& [monitor, image] : wish.background()) images.insert(image);
  return images;
}

absl::StatusOr<std::string> session_name(const std::string& pattern, std::int64_t item, absl::Time start) {
  if (pattern.empty()) return pattern;
  const absl::TimeZone utc = absl::UTCTimeZone();
  const std::string name = absl::StrReplaceAll(pattern, {{kItem, std::to_string(item)},
                                                         {"{date}", absl::FormatTime("%Y%m%d", start, utc)},
                                                         {"{time}", absl::FormatTime("%H%M%S", start, utc)}});
  if (name.find_first_of("{}") != std::string::npos) {
    return absl::InvalidArgumentError(fmt::format(
        "the session's name \"{}\" has other braces than {{item}}, {{date}} and {{time}}", pattern));
  }
  GW_RETURN_IF_ERROR(check_name("session", name));
  return name;
}

absl::Status check_wish(const v1::QueueWish& wish) {
  constexpr std::int64_t kLongNumber = 1'000'000'000;  // of an item, so that the name never gets too long
  GW_RETURN_IF_ERROR(session_name(wish.session(), kLongNumber, absl::UnixEpoch()).status());
  GW_RETURN_IF_ERROR(check_plan(wish.plan()));
  if (wish.solve() && wish.plan().has_calibration()) {
    return absl::InvalidArgumentError(
        "the plan measures devices and holds no object; it can be captured, but not solved");
  }
  for (const auto& [monitor, image] : wish.background()) {
    if (!monitor.empty()) GW_RETURN_IF_ERROR(check_name("monitor", monitor));
  }
  if (!wish.background().empty() && (!wish.solve() || wish.plan().has_ramp())) {
    return absl::InvalidArgumentError(
        wish.solve() ? "the plan is a video's; the queue composites stills: fetch its mattes, then glasswing "
                       "composite"
                     : "a background is for the composite of the solved session; ask for the solve too");
  }
  for (const std::string& tag : wish.tags()) GW_RETURN_IF_ERROR(check_name("tag", tag));
  for (const auto& [monitor, position_mm] : wish.rail_mm()) {
    if (std::isfinite(position_mm)) continue;
    return absl::InvalidArgumentError(
        fmt::format("rail_mm of monitor \"{}\" is {}; it must be a number of mm", monitor, position_mm));
  }
  for (const auto& [axis, position] : wish.axes()) {
    if (std::isfinite(position)) continue;
    return absl::InvalidArgumentError(
        fmt::format("axis \"{}\" is at {}; it must be a number of degrees or mm", axis, position));
  }
  if (!wish.empty_stage_of().empty()) GW_RETURN_IF_ERROR(check_name("session", wish.empty_stage_of()));
  GW_RETURN_IF_ERROR(check_range("retries", wish.retries(), 100));
  GW_RETURN_IF_ERROR(check_range("retry_wait_s", wish.retry_wait_s(), 86400));
  GW_RETURN_IF_ERROR(check_range("warm_up_s", wish.warm_up_s(), 86400));
  GW_RETURN_IF_ERROR(check_range("give_up_s", wish.give_up_s(), 1e7));
  if (!wish.deadline().empty() && !wish.solve())
    return absl::InvalidArgumentError("the deadline is the solve's; ask for the solve too");
  GW_RETURN_IF_ERROR(check_time("deadline", wish.deadline()));
  return check_time("not_before", wish.not_before());
}

v1::QueueWish copied_wish(v1::QueueWish wish) {
  const std::string& name = wish.session();
  if (!name.empty() && name.find(kItem) == std::string::npos)
    wish.set_session(fmt::format("{}-{}", name, kItem));
  return wish;
}

}  // namespace glasswing
