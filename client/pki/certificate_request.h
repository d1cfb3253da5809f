// Parses a request for a certificate: ROLE[+ROLE...]:NAME[=HOST,HOST...].
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <vector>

namespace glasswing {

struct CertificateRequest {
  std::string name;
  std::vector<std::string> roles;  // of kRoleNames, no duplicates
  std::vector<std::string> hosts;  // names and addresses at which others call it, no duplicates
};

// Without hosts, NAME is the host. INVALID_ARGUMENT names the wrong part.
absl::StatusOr<CertificateRequest> parse_certificate_request(const std::string& text);

// INVALID_ARGUMENT: not a valid file name, or reserved.
absl::Status check_certificate_name(const std::string& name);

// 10.0.0.5 or 2001:db8::1
bool is_ip_address(const std::string& host);

}  // namespace glasswing
