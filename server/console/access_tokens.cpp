#include "server/console/access_tokens.h"

#include <absl/strings/escaping.h>
#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>

#include "core/base/name.h"
#include "core/base/status.h"
#include "server/storage/row_checksums.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::hours kMaxValidity(24 * 365);
constexpr size_t kIdDigits = 12;

std::string hash_of(const std::string& secret) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  ::EVP_Digest(secret.data(), secret.size(), digest.data(), &size, EVP_sha256(), nullptr);
  return absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), size});
}

bool is_persons(std::string_view role) {
  return role == kRoleNames[static_cast<size_t>(Role::kOperator)] ||
         role == kRoleNames[static_cast<size_t>(Role::kViewer)];
}

absl::StatusOr<Database> open_database(const fs::path& file) {
  GW_ASSIGN_OR_RETURN(Database database, Database::open(file));
  GW_RETURN_IF_ERROR(
      database.run("CREATE TABLE IF NOT EXISTS tokens (id TEXT PRIMARY KEY, hash TEXT UNIQUE NOT NULL, "
                   "name TEXT NOT NULL, role TEXT NOT NULL, made_by TEXT NOT NULL, parent TEXT NOT NULL, "
                   "expires INTEGER NOT NULL); "
                   "CREATE TABLE IF NOT EXISTS logins (hash TEXT PRIMARY KEY, token TEXT NOT NULL)"));
  GW_RETURN_IF_ERROR(protect_rows(database, "tokens", kTokenColumns));
  GW_RETURN_IF_ERROR(protect_rows(database, "logins", kLoginColumns));
  GW_RETURN_IF_ERROR(database.check_structure());
  GW_RETURN_IF_ERROR(check_rows(database, "tokens", kTokenColumns));
  GW_RETURN_IF_ERROR(check_rows(database, "logins", kLoginColumns));
  return database;
}

}  // namespace

absl::StatusOr<std::unique_ptr<AccessTokens>> AccessTokens::open(const fs::path& data, Problems& problems) {
  const fs::path file = data / kTokensFile;
  absl::StatusOr<Database> database = open_database(file);
  if (absl::IsDataLoss(database.status())) {
    GW_RETURN_IF_ERROR(problems.set_aside_database(data, file, database.status(),
                                                   "browsers must log in again, with new "
                                                   "tokens"));
    database = open_database(file);
  }
  GW_RETURN_IF_ERROR(database.status());
  GW_ASSIGN_OR_RETURN(Database reader, Database::open(file));
  return std::unique_ptr<AccessTokens>(new AccessTokens(*std::move(database), std::move(reader)));
}

absl::Status AccessTokens::forget_ended(Seconds now) {
  GW_RETURN_IF_ERROR(database_.query("DELETE FROM tokens WHERE expires <= ?")
                         .bind(std::int64_t{now.time_since_epoch().count()})
                         .finish());
  return database_.run("DELETE FROM logins WHERE token NOT IN (SELECT id FROM tokens)");
}

absl::StatusOr<int> AccessTokens::count(const std::string& rows, const std::string& value) {
  Database::Query query = database_.query("SELECT count(*) FROM " + rows);
  if (!value.empty()) query.bind(value);
  const int count = query.next() ? static_cast<int>(query.integer(0)) : 0;
  GW_RETURN_IF_ERROR(query.status());
  return count;
}

absl::StatusOr<AccessToken> AccessTokens::find(Database& database, const std::string& condition,
                                               const std::string& value, Seconds now) {
  Database::Query query = database.query(
      "SELECT id, name, role, made_by, expires FROM tokens WHERE expires > ? AND " + condition);
  query.bind(std::int64_t{now.time_since_epoch().count()}).bind(value);
  const bool found = query.next();
  GW_RETURN_IF_ERROR(query.status());
  if (!found) {
    return absl::UnauthenticatedError(
        "this is not a token of this server, or it has expired or was revoked; `glasswing console token` "
        "makes one");
  }
  return AccessToken{.id = query.text(0),
                     .name = query.text(1),
                     .role = query.text(2),
                     .made_by = query.text(3),
                     .expires = Seconds(std::chrono::seconds(query.integer(4)))};
}

absl::StatusOr<AccessTokens::Made> AccessTokens::make(const Maker& maker, const std::string& name,
                                                      const std::string& role, Seconds expires, Seconds now) {
  GW_RETURN_IF_ERROR(check_name("user", name));
  if (!is_persons(role))
    return absl::InvalidArgumentError(fmt::format("the role is \"{}\"; it must be operator or viewer", role));
  if (expires <= now || expires - now > kMaxValidity)
    return absl::InvalidArgumentError("the token's validity must be above 0 and at most a year");
  Made made{
      .secret = random_token(),
      .token = {
          .name = name, .role = role, .made_by = maker.name, .expires = std::min(expires, maker.expires)}};
  const std::string hash = hash_of(made.secret);
  made.token.id = hash.substr(0, kIdDigits);
  const std::lock_guard lock(mutex_);
  if (!maker.token.empty()) {
    GW_ASSIGN_OR_RETURN(const AccessToken own, find(database_, "id = ?", maker.token, now));
    made.token.expires = std::min(made.token.expires, own.expires);
  }
  if (made.token.expires <= now)
    return absl::UnauthenticatedError("the caller's own certificate has expired");
  GW_RETURN_IF_ERROR(forget_ended(now));
  GW_ASSIGN_OR_RETURN(const int valid, count("tokens"));
  if (valid >= kMaxTokens) {
    return absl::ResourceExhaustedError(fmt::format(
        "{} tokens are valid, the maximum; end some with: glasswing console revoke ID", kMaxTokens));
  }
  GW_RETURN_IF_ERROR(database_
                         .query("INSERT INTO tokens (id, hash, name, role, made_by, parent, expires) VALUES "
                                "(?, ?, ?, ?, ?, ?, ?)")
                         .bind(made.token.id)
                         .bind(hash)
                         .bind(name)
                         .bind(role)
                         .bind(maker.name)
                         .bind(maker.token)
                         .bind(std::int64_t{made.token.expires.time_since_epoch().count()})
                         .finish());
  return made;
}

absl::StatusOr<std::vector<AccessToken>> AccessTokens::list(Seconds now) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(forget_ended(now));
  Database::Query query = database_.query(
      "SELECT id, name, role, made_by, expires, (SELECT count(*) FROM logins WHERE token = id) FROM tokens "
      "ORDER BY expires, id");
  std::vector<AccessToken> tokens;
  while (query.next()) {
    tokens.push_back({.id = query.text(0),
                      .name = query.text(1),
                      .role = query.text(2),
                      .made_by = query.text(3),
                      .expires = Seconds(std::chrono::seconds(query.integer(4))),
                      .login_count = static_cast<int>(query.integer(5))});
  }
  GW_RETURN_IF_ERROR(query.status());
  return tokens;
}

absl::Status AccessTokens::revoke(const std::string& id) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(
      database_
          .query(
              "WITH RECURSIVE ended(id) AS (SELECT id FROM tokens WHERE id = ? UNION SELECT tokens.id FROM "
              "tokens JOIN ended ON tokens.parent = ended.id) "
              "DELETE FROM tokens WHERE id IN (SELECT id FROM ended)")
          .bind(id)
          .finish());
  if (database_.changed() > 0) return absl::OkStatus();
  return absl::NotFoundError(
      fmt::format("there is no token \"{}\"; `glasswing console tokens` lists them", id));
}

absl::StatusOr<Login> AccessTokens::log_in(const std::string& token_secret, Seconds now) {
  const std::string secret = random_token(), hash = hash_of(secret);
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(forget_ended(now));
  GW_ASSIGN_OR_RETURN(const AccessToken token, find(database_, "hash = ?", hash_of(token_secret), now));
  GW_ASSIGN_OR_RETURN(const int logins, count("logins WHERE token = ?", token.id));
  if (logins >= kMaxLogins) {
    GW_RETURN_IF_ERROR(
        database_.query("DELETE FROM logins WHERE rowid = (SELECT min(rowid) FROM logins WHERE token = ?)")
            .bind(token.id)
            .finish());
  }
  GW_RETURN_IF_ERROR(
      database_.query("INSERT INTO logins (hash, token) VALUES (?, ?)").bind(hash).bind(token.id).finish());
  GW_ASSIGN_OR_RETURN(Principal principal, principal_of_hash(database_, hash, now));
  return Login{.secret = secret, .principal = std::move(principal)};
}

absl::StatusOr<Principal> AccessTokens::principal_of_hash(Database& database, const std::string& login,
                                                          Seconds now) {
  const absl::StatusOr<AccessToken> token =
      find(database, "id = (SELECT token FROM logins WHERE hash = ?)", login, now);
  if (absl::IsUnauthenticated(token.status()))
    return absl::UnauthenticatedError("this login has ended; `glasswing console token` makes a token");
  GW_RETURN_IF_ERROR(token.status());
  return Principal{.name = token->name,
                   .roles = role_of_uri(fmt::format("{}{}", kRoleUri, token->role)),
                   .expires = token->expires,
                   .token = token->id};
}

absl::StatusOr<Principal> AccessTokens::principal_of(const std::string& login_secret, Seconds now) {
  const std::lock_guard lock(reader_mutex_);
  return principal_of_hash(reader_, hash_of(login_secret), now);
}

absl::Status AccessTokens::log_out(const std::string& login_secret) {
  const std::lock_guard lock(mutex_);
  return database_.query("DELETE FROM logins WHERE hash = ?").bind(hash_of(login_secret)).finish();
}

}  // namespace glasswing
