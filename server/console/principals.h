// The principal of an HTTP request, by its client certificate or by the login in its cookie.
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include "server/console/access_tokens.h"

namespace glasswing {

inline constexpr const char* kConsoleCookie = "glasswing-console";

// A certificate was verified when the connection was made. UNAUTHENTICATED: neither a certificate nor a login
// that has not ended.
absl::StatusOr<Principal> principal_of(const httplib::Request& request, AccessTokens& tokens);

// Protects logged-in users against requests forged by other pages in their browser. PERMISSION_DENIED: the
// request comes from another page; or is a POST without the header X-Glasswing, which only our scripts set;
// or, without TLS (whose certificate would have to match), the Host header does not name this machine (DNS
// rebinding).
absl::Status check_origin(const httplib::Request& request, bool has_tls);

// The "Set-Cookie" value that sets a login, or, with an empty one and no validity, removes it.
std::string cookie_of(const std::string& login, std::chrono::seconds valid, bool has_tls);

}  // namespace glasswing
