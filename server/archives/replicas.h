// The nodes that hold replicas of a session's archive.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/rig/node_registry.h"

namespace glasswing {

// An incompletely copied replica has no address in the catalogue. It is listed only to be deleted.
inline bool is_whole(const v1::ArchiveCopy& copy) {
  return !copy.address().empty();
}

// The addresses of complete replicas. A node that is up is found by its name, because its address may have
// changed since the replica was made; for an unreachable one the old address is returned.
std::vector<std::string> replica_addresses(const v1::Session& session, const NodeRegistry& rig);

// The address of a node that can store or delete a replica. NOT_FOUND: no node of that name has registered.
// UNAVAILABLE: it does not answer. FAILED_PRECONDITION: it does not store archives.
absl::StatusOr<std::string> keeper_address(const std::string& node, const NodeRegistry& rig);

}  // namespace glasswing
