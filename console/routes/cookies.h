// The cookie that holds a browser's login, and where requests may come from.
#pragma once

#include <absl/status/status.h>
#include <httplib.h>

#include <chrono>
#include <string>

namespace glasswing {

inline constexpr const char* kConsoleCookie = "glasswing-console";

// The secret of the request's login; empty: it has none.
std::string login_in(const httplib::Request& request);

// Protects logged-in users against requests forged by other pages in their browser. PERMISSION_DENIED: the
// request comes from another page; or is a POST without the header X-Glasswing, which only our scripts set;
// or, without TLS (whose certificate would have to match), the Host header does not name this machine (DNS
// rebinding).
absl::Status check_origin(const httplib::Request& request, bool has_tls);

// The "Set-Cookie" value that sets a login, or, with an empty one and no validity, removes it.
std::string cookie_of(const std::string& login, std::chrono::seconds valid, bool has_tls);

}  // namespace glasswing
