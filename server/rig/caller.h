// The client of a call, from its metadata.
#pragma once

#include <grpcpp/grpcpp.h>

#include "server/rig/rig_lock.h"

namespace glasswing {

inline Caller caller_of(const grpc::ServerContext& context) {
  constexpr size_t kMaxBytes = 200;  // of the client's name, which is shown to others
  const auto& metadata = context.client_metadata();
  const auto value = [&metadata](const char* key) {
    const auto found = metadata.find(key);
    return found == metadata.end() ? std::string() : std::string(found->second.data(), found->second.size());
  };
  return {.client = value("glasswing-client").substr(0, kMaxBytes), .hold = value("glasswing-hold")};
}

}  // namespace glasswing
