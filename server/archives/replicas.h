// The nodes that hold replicas of a session's archive.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/rig/node_registry.h"

namespace glasswing {

// A replica whose copying broke off has no address in the catalogue. It is listed only to be deleted.
inline bool is_whole(const v1::ArchiveCopy& copy) {
  return !copy.address().empty();
}

// The addresses of whole replicas. A node that is up is found by its name, because its address may have
// changed since it took the replica; one that is away has its old address.
std::vector<std::string> replica_addresses(const v1::Session& session, const NodeRegistry& rig);

// The address of a node that can take or delete a replica. NOT_FOUND: no node of that name has registered.
// UNAVAILABLE: it is away. FAILED_PRECONDITION: it keeps no archives.
absl::StatusOr<std::string> keeper_address(const std::string& node, const NodeRegistry& rig);

}  // namespace glasswing
