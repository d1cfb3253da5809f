// The limits of messages from peers, as the fields' options in the protos say (limits.proto).
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <string>

#include "core/service/service.h"

namespace glasswing {

// Of fields without the options.
inline constexpr int kMaxStringBytes = 1024, kMaxListItems = 1000;

// INVALID_ARGUMENT names the first string, list or map, at any depth, that exceeds its limit:
// "plan.monitors[3].name has 2000 bytes; it must have at most 64". Fields of type bytes are not limited here:
// they are chunks of a stream, whose total the receiver limits.
absl::Status check_limits(const google::protobuf::Message& message);

// For the beginning of a service's method: returns check_limits() from it unless it is OK.
#define GW_CHECK_LIMITS(message) \
  if (const absl::Status gw_limits = check_limits(message); !gw_limits.ok()) return to_grpc(gw_limits)

// The text cut to the limit of a field, between characters: for senders.
std::string fitted(std::string text, int max_bytes = kMaxStringBytes);

}  // namespace glasswing
