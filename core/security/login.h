// People who call through the console: by logins, which the server alone can check.
#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <functional>
#include <string>

#include "core/security/roles.h"

namespace glasswing {

// Metadata of a call that the console makes for a person: the secret of that person's login.
inline constexpr char kLoginMetadata[] = "glasswing-login";

// Who logged in.
struct Principal {
  std::string name;
  Roles roles = 0;
  std::chrono::sys_seconds expires = {};
  std::string token = {};  // the id of the token that logged it in

  // For the audit log, which names a token's maker when the token is made.
  std::string title() const { return name + " (token " + token + ")"; }
};

struct Login {
  std::string secret;  // in a browser's cookie
  Principal principal;
};

// The principal of a login's secret, at once: gRPC's own threads ask. UNAUTHENTICATED: the login has ended.
using PrincipalOf = std::function<absl::StatusOr<Principal>(const std::string& login)>;

}  // namespace glasswing
