#include "server/console/console_key.h"

#include <absl/strings/escaping.h>
#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/rand.h>

#include <algorithm>
#include <array>
#include <charconv>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr std::chrono::hours kMaxValidity(24 * 365);

absl::Status make_key(const fs::path& path) {
  std::array<unsigned char, 32> key{};
  if (::RAND_bytes(key.data(), static_cast<int>(key.size())) != 1)
    return absl::InternalError("the random number generator failed");
  GW_RETURN_IF_ERROR(write_secret_flushed(path, {reinterpret_cast<const char*>(key.data()), key.size()}));
  return flush_directory(path.parent_path());
}

bool is_persons(std::string_view role) {
  return role == kRoleNames[static_cast<size_t>(Role::kOperator)] ||
         role == kRoleNames[static_cast<size_t>(Role::kViewer)];
}

}  // namespace

absl::StatusOr<ConsoleKey> ConsoleKey::open(const fs::path& data) {
  const fs::path path = data / "console-key";
  if (!fs::exists(path)) GW_RETURN_IF_ERROR(make_key(path));
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
  ConsoleKey key;
  if (bytes.size() != key.key_.size()) {
    return absl::DataLossError(
        fmt::format("{} has {} bytes instead of {}; remove it, and browsers have to log in again",
                    path.string(), bytes.size(), key.key_.size()));
  }
  std::ranges::copy(bytes, key.key_.begin());
  return key;
}

std::string ConsoleKey::signature_of(std::string_view text) const {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  ::HMAC(EVP_sha256(), key_.data(), static_cast<int>(key_.size()),
         reinterpret_cast<const unsigned char*>(text.data()), text.size(), digest.data(), &size);
  return absl::WebSafeBase64Escape({reinterpret_cast<const char*>(digest.data()), size});
}

absl::StatusOr<std::string> ConsoleKey::token_of(const std::string& name, const std::string& role,
                                                 std::chrono::sys_seconds expires,
                                                 std::chrono::sys_seconds now) const {
  GW_RETURN_IF_ERROR(check_name("user", name));
  if (!is_persons(role))
    return absl::InvalidArgumentError(fmt::format("the role is \"{}\"; it must be operator or viewer", role));
  if (expires <= now || expires - now > kMaxValidity)
    return absl::InvalidArgumentError("the token's validity must be above 0 and at most a year");
  const std::string text =
      absl::WebSafeBase64Escape(fmt::format("{} {} {}", role, expires.time_since_epoch().count(), name));
  return fmt::format("{}.{}", text, signature_of(text));
}

absl::StatusOr<Principal> ConsoleKey::principal_of(std::string_view token,
                                                   std::chrono::sys_seconds now) const {
  const absl::Status unknown =
      absl::UnauthenticatedError("that is no token of this server; `glasswing console token` makes one");
  const size_t dot = token.find('.');
  if (dot == std::string_view::npos) return unknown;
  const std::string_view text = token.substr(0, dot), shown = token.substr(dot + 1);
  const std::string right = signature_of(text);
  if (shown.size() != right.size() || ::CRYPTO_memcmp(shown.data(), right.data(), right.size()) != 0)
    return unknown;
  std::string content;
  if (!absl::WebSafeBase64Unescape({text.data(), text.size()}, &content)) return unknown;
  const size_t first = content.find(' '), second = content.find(' ', first + 1);
  if (second == std::string::npos) return unknown;
  std::int64_t expires = 0;
  std::from_chars(content.data() + first + 1, content.data() + second, expires);
  Principal principal{.name = content.substr(second + 1),
                      .roles = role_of_uri(fmt::format("{}{}", kRoleUri, content.substr(0, first))),
                      .expires = std::chrono::sys_seconds(std::chrono::seconds(expires))};
  if (principal.expires > now) return principal;
  return absl::UnauthenticatedError("this token has expired; make another one");
}

}  // namespace glasswing
