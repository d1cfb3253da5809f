// The nodes that hold copies of a session's archive.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/rig/node_registry.h"

namespace glasswing {

// Whose copying broke off has no address in the catalogue: only its removal knows of it.
inline bool is_whole(const v1::ArchiveCopy& copy) {
  return !copy.address().empty();
}

// Where the copies that are whole can be read. A node that is up is found by its name, since its address may
// be another one than when it took the copy; of one that is away the old address is told.
std::vector<std::string> replica_addresses(const v1::Session& session, const NodeRegistry& rig);

// Where a node is that is to take, or give up, a copy. NOT_FOUND: nobody of that name has registered;
// UNAVAILABLE: it is away; FAILED_PRECONDITION: it is one that keeps no archives.
absl::StatusOr<std::string> keeper_address(const std::string& node, const NodeRegistry& rig);

}  // namespace glasswing
