#include "core/base/utc.h"

#include <absl/time/clock.h>
#include <absl/time/time.h>

namespace glasswing {

std::string utc_rfc3339_ago(nanoseconds ago) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::Now() - absl::FromChrono(ago), absl::UTCTimeZone());
}

}  // namespace glasswing
