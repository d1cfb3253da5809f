// Who a request of HTTP comes from: by a client's certificate, or by the token in its cookie.
#pragma once

#include <absl/status/statusor.h>
#include <httplib.h>

#include "server/console/console_key.h"

namespace glasswing {

inline constexpr const char* kConsoleCookie = "glasswing-console";

// UNAUTHENTICATED: nobody that we know. Of a certificate (verified when the connection was made) the roles
// are those that it has; it does not expire here.
absl::StatusOr<Principal> principal_of(const httplib::Request& request, const ConsoleKey& key);

// Guards a browser's visitors against pages of others that it shows. PERMISSION_DENIED: the request comes
// from another page, or would change something and does not say by the header X-Glasswing that a script of
// ours made it; or, where there is no TLS whose certificate had to match, the host is not this machine by
// name, as of a page that had its own name point here.
absl::Status check_origin(const httplib::Request& request, bool has_tls);

// "Set-Cookie" of a token, or that takes it away again.
std::string cookie_of(const std::string& token, std::chrono::seconds valid, bool has_tls);

}  // namespace glasswing
