// A certificate as people ask for it: ROLE[+ROLE...]:NAME[=HOST,HOST...].
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <vector>

namespace glasswing {

struct CertificateRequest {
  std::string name;
  std::vector<std::string> roles;  // of kRoleNames, once each
  std::vector<std::string> hosts;  // names and addresses that the others call it by, once each
};

// Without hosts its name is one. INVALID_ARGUMENT says what is not of that form.
absl::StatusOr<CertificateRequest> parse_certificate_request(const std::string& text);

// Whether files may be called so: INVALID_ARGUMENT if not.
absl::Status check_certificate_name(const std::string& name);

// 10.0.0.5 or 2001:db8::1
bool is_ip_address(const std::string& host);

}  // namespace glasswing
