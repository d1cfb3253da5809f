#include "console/routes/cookies.h"

#include <fmt/format.h>

#include "core/security/tls.h"

namespace glasswing {
namespace {

// The value of a cookie in the header "Cookie: a=1; b=2".
std::string cookie_in(const std::string& header, const std::string& name) {
  for (size_t at = 0; at < header.size();) {
    const size_t end = std::min(header.find(';', at), header.size());
    const size_t first = std::min(header.find_first_not_of(' ', at), end);
    if (header.compare(first, name.size() + 1, name + "=") == 0)
      return header.substr(first + name.size() + 1, end - first - name.size() - 1);
    at = end + 1;
  }
  return "";
}

}  // namespace

std::string login_in(const httplib::Request& request) {
  return cookie_in(request.get_header_value("Cookie"), kConsoleCookie);
}

absl::Status check_origin(const httplib::Request& request, bool has_tls) {
  const std::string host = request.get_header_value("Host");
  if (!has_tls &&
      !is_loopback(host.find_last_of(":]") == std::string::npos || host.back() == ']' ? host + ":0" : host))
    return absl::PermissionDeniedError(
        fmt::format("without TLS the console answers only as localhost or 127.0.0.1, not as \"{}\"", host));
  const std::string site = request.get_header_value("Sec-Fetch-Site"),
                    origin = request.get_header_value("Origin");
  const bool foreign =
      (!site.empty() && site != "same-origin" && site != "none") ||
      (!origin.empty() && origin != fmt::format("{}://{}", has_tls ? "https" : "http", host));
  if (foreign)
    return absl::PermissionDeniedError(
        "the request comes from another page; the console answers only its own pages");
  if (request.method == "POST" && request.get_header_value("X-Glasswing") != "console")
    return absl::PermissionDeniedError("a POST needs the header \"X-Glasswing: console\"");
  return absl::OkStatus();
}

std::string cookie_of(const std::string& login, std::chrono::seconds valid, bool has_tls) {
  return fmt::format("{}={}; Path=/; Max-Age={}; HttpOnly; SameSite=Strict{}", kConsoleCookie, login,
                     valid.count(), has_tls ? "; Secure" : "");
}

}  // namespace glasswing
