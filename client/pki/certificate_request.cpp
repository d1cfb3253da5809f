#include "client/pki/certificate_request.h"

#include <absl/strings/str_split.h>
#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <regex>
#include <set>

#include "core/base/status.h"
#include "core/security/roles.h"

namespace glasswing {
namespace {

absl::Status check_role(const std::string& role) {
  if (std::ranges::find(kRoleNames, role) != kRoleNames.end()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("\"{}\" is not a role; the roles are {}", role, fmt::join(kRoleNames, ", ")));
}

absl::Status check_host(const std::string& host) {
  static const std::regex kHostName(
      R"((?=.{1,253}$)[A-Za-z0-9_]([A-Za-z0-9_-]{0,62})(\.[A-Za-z0-9_][A-Za-z0-9_-]{0,62})*)");
  static const std::regex kNumbers(R"([0-9.]+)");
  if (is_ip_address(host) || (std::regex_match(host, kHostName) && !std::regex_match(host, kNumbers)))
    return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "\"{}\" is not a host; it must be a name such as rig.lab, or an address such as 10.0.0.5", host));
}

absl::Status check_once(const std::vector<std::string>& words) {
  std::set<std::string> seen;
  for (const std::string& word : words) {
    if (!seen.insert(word).second)
      return absl::InvalidArgumentError(fmt::format("\"{}\" is there twice", word));
  }
  return absl::OkStatus();
}

absl::StatusOr<CertificateRequest> parse(const std::string& text) {
  const size_t colon = text.find(':');
  if (colon == std::string::npos) {
    return absl::InvalidArgumentError("it must be ROLE:NAME or ROLE:NAME=HOST,HOST...");
  }
  const std::string rest = text.substr(colon + 1);
  const size_t equals = rest.find('=');
  CertificateRequest request;
  request.name = rest.substr(0, equals);
  request.roles = absl::StrSplit(text.substr(0, colon), '+');
  if (equals == std::string::npos) {
    request.hosts = {request.name};
  } else {
    request.hosts = absl::StrSplit(rest.substr(equals + 1), ',');
  }
  GW_RETURN_IF_ERROR(check_certificate_name(request.name));
  for (const std::string& role : request.roles) GW_RETURN_IF_ERROR(check_role(role));
  for (const std::string& host : request.hosts) GW_RETURN_IF_ERROR(check_host(host));
  GW_RETURN_IF_ERROR(check_once(request.roles));
  GW_RETURN_IF_ERROR(check_once(request.hosts));
  return request;
}

}  // namespace

absl::StatusOr<CertificateRequest> parse_certificate_request(const std::string& text) {
  absl::StatusOr<CertificateRequest> request = parse(text);
  if (request.ok()) return request;
  return absl::InvalidArgumentError(fmt::format("{}: {}", text, std::string(request.status().message())));
}

absl::Status check_certificate_name(const std::string& name) {
  static const std::regex kName("[A-Za-z0-9][A-Za-z0-9._-]{0,63}");
  if (std::regex_match(name, kName) && name != "ca") return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "the name is \"{}\"; it must be up to 64 letters, digits, '.', '_' and '-', and not ca", name));
}

bool is_ip_address(const std::string& host) {
  in6_addr address{};
  return ::inet_pton(AF_INET, host.c_str(), &address) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

}  // namespace glasswing
