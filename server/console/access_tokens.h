// Tokens with which browsers log in to the console, and the logins made with them. Both are random secrets,
// of which only SHA-256 hashes are stored; a token's id is the beginning of its hash.
//
//   token   in the link that `glasswing console token` prints; logs browsers in until it expires
//   login   in a browser's cookie; ends at logout, or with its token
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/security/login.h"
#include "server/storage/database.h"
#include "server/storage/problems.h"

namespace glasswing {

struct AccessToken {
  std::string id = {};
  std::string name;     // its owner's
  std::string role;     // "operator" or "viewer"
  std::string made_by;  // human-readable: who asked for it
  std::chrono::sys_seconds expires = {};
  int login_count = 0;
};

// Thread-safe. Everything is durable once a method returns OK, so logins survive a restart of the server.
class AccessTokens {
 public:
  using Seconds = std::chrono::sys_seconds;
  static Seconds current_time() {
    return std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  }
  static constexpr int kMaxTokens = 1000;
  static constexpr int kMaxLogins = 100;  // of a token; beyond it the oldest ends

  // A damaged file is set aside, and `problems` says so: browsers then have to log in again.
  static absl::StatusOr<std::unique_ptr<AccessTokens>> open(const std::filesystem::path& data,
                                                            Problems& problems);

  // The requester of a token. The token ends at `expires`, and when the maker's own `token` is revoked.
  struct Maker {
    std::string name;
    Seconds expires = Seconds::max();  // of its certificate or token
    std::string token = {};            // the id of its own token; empty: it has none
  };
  struct Made {
    std::string secret;
    AccessToken token;
  };
  // INVALID_ARGUMENT: the name, a role that is not "operator" or "viewer", or an expiry time before `now` or
  // more than a year after it. UNAUTHENTICATED: the maker's own token is no longer valid. RESOURCE_EXHAUSTED:
  // kMaxTokens are valid.
  absl::StatusOr<Made> make(const Maker& maker, const std::string& name, const std::string& role,
                            Seconds expires, Seconds now);
  // The valid ones, sorted by expiry.
  absl::StatusOr<std::vector<AccessToken>> list(Seconds now);
  // Ends a token, the tokens made with it, and all their logins. NOT_FOUND: there is no such token.
  absl::Status revoke(const std::string& id);

  // UNAUTHENTICATED: not a token of this server, or it has expired or was revoked.
  absl::StatusOr<Login> log_in(const std::string& token_secret, Seconds now);
  // The principal of a login. UNAUTHENTICATED: the login has ended.
  absl::StatusOr<Principal> principal_of(const std::string& login_secret, Seconds now);
  // Also for a login that has ended.
  absl::Status log_out(const std::string& login_secret);

 private:
  AccessTokens(Database database, Database reader)
      : database_(std::move(database)), reader_(std::move(reader)) {}
  // The remaining ones need the mutex of their database.
  absl::Status forget_ended(Seconds now);
  absl::StatusOr<int> count(const std::string& rows, const std::string& value = "");
  // The valid token that meets `condition`, which has one "?" for `value`.
  static absl::StatusOr<AccessToken> find(Database& database, const std::string& condition,
                                          const std::string& value, Seconds now);
  static absl::StatusOr<Principal> principal_of_hash(Database& database, const std::string& login,
                                                     Seconds now);

  std::mutex mutex_;
  Database database_;
  // For principal_of(), which every console call needs: it never waits for a disk write.
  std::mutex reader_mutex_;
  Database reader_;
};

}  // namespace glasswing
