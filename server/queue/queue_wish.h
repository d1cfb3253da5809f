// What people wish of an item of the queue, checked.
#pragma once

#include <absl/status/status.h>
#include <absl/time/time.h>

#include <cstdint>
#include <set>
#include <string>

#include "glasswing/v1/queue_service.pb.h"

namespace glasswing {

// INVALID_ARGUMENT names the field and what it takes. What the rig must have is found when the item runs.
absl::Status check_wish(const v1::QueueWish& wish);

// The uploaded images that it names: its plan's photos and its backgrounds.
std::set<std::string> images_of(const v1::QueueWish& wish);

// The pattern with {item}, {date} and {time} filled in. INVALID_ARGUMENT: it holds other braces, or what
// comes out is no session's name. Empty: empty.
absl::StatusOr<std::string> session_name(const std::string& pattern, std::int64_t item, absl::Time start);

// The wish of a copy: where its session has a fixed name, the copy's has its number behind it.
v1::QueueWish copied_wish(v1::QueueWish wish);

// Until then the item waits: the past, where it does not.
absl::Time earliest_start(const v1::QueueWish& wish);

}  // namespace glasswing
