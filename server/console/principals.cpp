#include "server/console/principals.h"

#include <fmt/format.h>
#include <openssl/ssl.h>

#include "core/security/pem.h"
#include "core/security/tls.h"

namespace glasswing {
namespace {

Principal principal_of(const X509& certificate) {
  Principal principal{.name = "", .expires = std::chrono::sys_seconds::max()};
  const X509_NAME* subject = X509_get_subject_name(&certificate);
  if (const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1); at >= 0)
    principal.name = text_of(*X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
  const AltNames names = alt_names_of(certificate);
  for (int i = 0; i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME& each = *sk_GENERAL_NAME_value(names.get(), i);
    if (each.type == GEN_URI) principal.roles |= role_of_uri(text_of(*each.d.uniformResourceIdentifier));
  }
  return principal;
}

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

absl::StatusOr<Principal> principal_of(const httplib::Request& request, const ConsoleKey& key) {
  if (request.ssl != nullptr) {
    const Certificate shown(SSL_get1_peer_certificate(request.ssl));
    if (shown != nullptr) return principal_of(*shown);
  }
  const std::string token = cookie_in(request.get_header_value("Cookie"), kConsoleCookie);
  if (token.empty())
    return absl::UnauthenticatedError("nobody is logged in; `glasswing console token` makes a token");
  return key.principal_of(token, std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now()));
}

absl::Status check_origin(const httplib::Request& request, bool has_tls) {
  const std::string host = request.get_header_value("Host");
  if (!has_tls &&
      !is_loopback(host.find_last_of(":]") == std::string::npos || host.back() == ']' ? host + ":0" : host))
    return absl::PermissionDeniedError(
        fmt::format("without TLS the console answers as localhost or 127.0.0.1 alone, not as \"{}\"", host));
  const std::string site = request.get_header_value("Sec-Fetch-Site"),
                    origin = request.get_header_value("Origin");
  const bool foreign =
      (!site.empty() && site != "same-origin" && site != "none") ||
      (!origin.empty() && origin != fmt::format("{}://{}", has_tls ? "https" : "http", host));
  if (foreign)
    return absl::PermissionDeniedError(
        "the request comes from another page; the console answers only its own");
  if (request.method == "POST" && request.get_header_value("X-Glasswing") != "console")
    return absl::PermissionDeniedError("a POST needs the header \"X-Glasswing: console\"");
  return absl::OkStatus();
}

std::string cookie_of(const std::string& token, std::chrono::seconds valid, bool has_tls) {
  return fmt::format("{}={}; Path=/; Max-Age={}; HttpOnly; SameSite=Strict{}", kConsoleCookie, token,
                     valid.count(), has_tls ? "; Secure" : "");
}

}  // namespace glasswing
