// Access control by role. A certificate names its roles by URIs among its alternative names, such as
// urn:glasswing:role:solver.
#pragma once

#include <absl/status/status.h>

#include <array>
#include <span>
#include <string>
#include <string_view>

namespace glasswing {

// An operator runs the rig, a viewer only looks; both are people, as are a planner, who may also fill the
// queue, an approver its items, a runner run captures, solves and the queue, and a deleter end sessions. The
// others are programs.
enum class Role {
  kOperator,
  kViewer,
  kServer,
  kDisplay,
  kCamera,
  kSolver,
  kConsole,
  kPlanner,
  kApprover,
  kRunner,
  kDeleter
};
inline constexpr std::array<std::string_view, 11> kRoleNames{"operator", "viewer", "server",  "display",
                                                             "camera",   "solver", "console", "planner",
                                                             "approver", "runner", "deleter"};
inline constexpr std::string_view kRoleUri = "urn:glasswing:role:";  // the role's name follows

using Roles = unsigned;  // bits
constexpr Roles only(Role role) {
  return 1u << static_cast<unsigned>(role);
}
// Nodes that keep archives, and those that a server calls.
inline constexpr Roles kArchiveKeepers = only(Role::kCamera) | only(Role::kSolver);
inline constexpr Roles kNodes = only(Role::kDisplay) | kArchiveKeepers;
// "solver+camera"; "none".
std::string names_of(Roles roles, std::string_view between = "+");
// No roles if the URI names none.
Roles role_of_uri(std::string_view uri);

// The roles that may call one method. `audited`: each call is logged with its caller's name, because it
// changes something that people care about, or hands out captured data.
struct MethodAccess {
  std::string_view method;  // "WorkService/ClaimTile"
  Roles roles;
  bool audited = false;

  bool allows(Role role) const { return (roles & only(role)) != 0; }
};

// One entry for every method of every service.
std::span<const MethodAccess> access_table();

// Checks one call against the table, and logs it if it is audited or refused. `method`:
// "WorkService/ClaimTile". PERMISSION_DENIED says which roles the method is for, and which ones `caller` has.
// A method that is not in the table is admitted: gRPC answers that it does not exist.
absl::Status admit(std::string_view method, Roles roles, std::string_view caller);

}  // namespace glasswing
