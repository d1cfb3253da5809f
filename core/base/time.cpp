#include "core/base/time.h"

#include <absl/time/clock.h>
#include <absl/time/time.h>

#include <cerrno>
#include <ctime>

namespace glasswing {

nanoseconds monotonic_now() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return std::chrono::seconds(now.tv_sec) + nanoseconds(now.tv_nsec);
}

void sleep_until_monotonic(nanoseconds deadline) {
  const auto seconds = std::chrono::floor<std::chrono::seconds>(deadline);
  const timespec until{.tv_sec = seconds.count(), .tv_nsec = (deadline - seconds).count()};
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

std::string utc_now_rfc3339() {
  return utc_rfc3339_ago(nanoseconds(0));
}

std::string utc_rfc3339_ago(nanoseconds ago) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::Now() - absl::FromChrono(ago), absl::UTCTimeZone());
}

}  // namespace glasswing
