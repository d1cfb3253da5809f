// Who may call what. A certificate says its roles by URIs among its alternative names, such as
// urn:glasswing:role:solver.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/security/auth_metadata_processor.h>

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace glasswing {

// operator: a person who runs sessions. viewer: one who looks at them. The others are programs.
enum class Role { kOperator, kViewer, kServer, kDisplay, kCamera, kSolver };
inline constexpr std::array<std::string_view, 6> kRoleNames{"operator", "viewer", "server",
                                                            "display",  "camera", "solver"};
inline constexpr std::string_view kRoleUri = "urn:glasswing:role:";  // the role's name follows

using Roles = unsigned;  // bits
constexpr Roles only(Role role) {
  return 1u << static_cast<unsigned>(role);
}
// None: the URI names no role.
Roles role_of_uri(std::string_view uri);

// Callers of one method. `audited`: each call is logged with its caller's name, for it changes something that
// a person cares for, or hands out what was captured.
struct MethodAccess {
  std::string_view method;  // "WorkService/ClaimTile"
  Roles roles;
  bool audited = false;

  bool allows(Role role) const { return (roles & only(role)) != 0; }
};

// Of every method of every service, once each.
std::span<const MethodAccess> access_table();

// Holds one call against the table, and logs what is audited or refused. `method`: "WorkService/ClaimTile".
// PERMISSION_DENIED says which roles it is for, and which `caller` has. A method that is not there is let
// through: the answer says so.
absl::Status admit(std::string_view method, Roles roles, std::string_view caller);

// Holds every call against the table by its caller's certificate: Methods that are not ours (health,
// reflection) are for every certificate.
std::shared_ptr<grpc::AuthMetadataProcessor> role_gate();

}  // namespace glasswing
