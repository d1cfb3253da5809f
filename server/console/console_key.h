// Tokens of the console: signed texts that name a principal, its role and an expiry time. A browser presents
// the token once to log in and keeps it as its cookie, so logins survive a restart of the server.
//
//   token = base64url(role SP expires SP name) "." base64url(HMAC-SHA256(key, the part before the dot))
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/security/roles.h"

namespace glasswing {

// An authenticated user.
struct Principal {
  std::string name;
  Roles roles = 0;
  std::chrono::sys_seconds expires = {};
};

class ConsoleKey {
 public:
  // Reads the key in `data`, or creates it, readable only by its owner. Removing the key voids all tokens
  // that it signed. DATA_LOSS: the file is not a key.
  static absl::StatusOr<ConsoleKey> open(const std::filesystem::path& data);

  // INVALID_ARGUMENT: the name, a role that is not "operator" or "viewer", or an expiry time before `now` or
  // more than a year after it.
  absl::StatusOr<std::string> token_of(const std::string& name, const std::string& role,
                                       std::chrono::sys_seconds expires, std::chrono::sys_seconds now) const;
  // UNAUTHENTICATED: not a token of this server, or an expired one.
  absl::StatusOr<Principal> principal_of(std::string_view token, std::chrono::sys_seconds now) const;

 private:
  ConsoleKey() = default;
  std::string signature_of(std::string_view text) const;

  std::array<unsigned char, 32> key_{};
};

}  // namespace glasswing
