// Who may call what. A certificate says its roles by URIs among its alternative names, such as
// urn:glasswing:role:solver.
#pragma once

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

// Callers of one method. `audited`: each call is logged with its caller's name, for it changes something that
// a person cares for, or hands out what was captured.
struct MethodAccess {
  std::string_view method;  // "WorkService/ClaimTile"
  unsigned roles;           // bits, 1 << Role
  bool audited = false;

  bool allows(Role role) const { return (roles >> static_cast<unsigned>(role) & 1u) != 0; }
};

// Of every method of every service, once each.
std::span<const MethodAccess> access_table();

// Holds every call against the table: PERMISSION_DENIED says which roles the method is for, and which the
// caller's certificate has. Methods that are not ours (health, reflection) are for every certificate.
std::shared_ptr<grpc::AuthMetadataProcessor> role_gate();

}  // namespace glasswing
