// Tokens of the console: a text that says whose browser may look and for how long, signed by the server. A
// browser shows it once to log in, and keeps it as its cookie; so a server that is started anew knows its
// visitors.
//
//   token = base64url(role SP expires SP name) "." base64url(HMAC-SHA256(key, what is before the dot))
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/security/roles.h"

namespace glasswing {

struct Principal {
  std::string name;
  Roles roles = 0;
  std::chrono::sys_seconds expires = {};
};

class ConsoleKey {
 public:
  // The one in `data`, made where there is none, for its owner's eyes alone. Without it, all tokens that it
  // signed are void. DATA_LOSS: it is none.
  static absl::StatusOr<ConsoleKey> open(const std::filesystem::path& data);

  // INVALID_ARGUMENT: the name, a role that is not "operator" or "viewer", or a time that is over by `now` or
  // more than a year away.
  absl::StatusOr<std::string> token_of(const std::string& name, const std::string& role,
                                       std::chrono::sys_seconds expires, std::chrono::sys_seconds now) const;
  // UNAUTHENTICATED: it is not a token of this server, or no longer.
  absl::StatusOr<Principal> principal_of(std::string_view token, std::chrono::sys_seconds now) const;

 private:
  ConsoleKey() = default;
  std::string signature_of(std::string_view text) const;

  std::array<unsigned char, 32> key_{};
};

}  // namespace glasswing
