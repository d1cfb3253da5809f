// The principal of an HTTP request, by its client certificate or by the token in its cookie.
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include "server/console/console_key.h"

namespace glasswing {

inline constexpr const char* kConsoleCookie = "glasswing-console";

// A certificate, which was verified when the connection was made, provides name and roles; it does not expire
// here. UNAUTHENTICATED: neither a certificate nor a valid token.
absl::StatusOr<Principal> principal_of(const httplib::Request& request, const ConsoleKey& key);

// Protects logged-in users against requests forged by other pages in their browser. PERMISSION_DENIED: the
// request comes from another page; or is a POST without the header X-Glasswing, which only our scripts set;
// or, without TLS (whose certificate would have to match), the Host header does not name this machine (DNS
// rebinding).
absl::Status check_origin(const httplib::Request& request, bool has_tls);

// The "Set-Cookie" value that sets a token, or, with an empty token and no validity, removes it.
std::string cookie_of(const std::string& token, std::chrono::seconds valid, bool has_tls);

}  // namespace glasswing
