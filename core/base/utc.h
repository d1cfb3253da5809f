// Times of day, for people and for records.
#pragma once

#include <string>

#include "core/base/time.h"

namespace glasswing {

// "2026-01-31T12:00:00Z": the time that was so long ago.
std::string utc_rfc3339_ago(nanoseconds ago);

}  // namespace glasswing
