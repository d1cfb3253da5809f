#include "core/security/role_gate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/status.h"
#include "core/security/call_shares.h"
#include "core/security/peer.h"

namespace glasswing {
namespace {

class RoleGate final : public grpc::AuthMetadataProcessor {
 public:
  explicit RoleGate(PrincipalOf principal_of) : principal_of_(std::move(principal_of)) {}

  bool IsBlocking() const override { return false; }

  grpc::Status Process(const InputMetadata& metadata, grpc::AuthContext* caller, OutputMetadata*,
                       OutputMetadata*) override {
    absl::Status admitted = check(metadata, *caller);
    if (admitted.ok() && shows_certificate(*caller))
      admitted = call_shares().admit(name_of(*caller), roles_of(*caller), CallShares::Time::clock::now());
    return {static_cast<grpc::StatusCode>(admitted.code()), std::string(admitted.message())};
  }

 private:
  absl::Status check(const InputMetadata& metadata, const grpc::AuthContext& caller) const {
    const auto path = metadata.find(":path");
    if (path == metadata.end()) return absl::PermissionDeniedError("the call names no method");
    std::string_view method(path->second.data(), path->second.size());
    static constexpr std::string_view kOurs = "/glasswing.v1.";
    if (!method.starts_with(kOurs)) return absl::OkStatus();
    method.remove_prefix(kOurs.size());
    const auto [first, last] = metadata.equal_range(kLoginMetadata);
    if (first != last) {
      if (std::next(first) != last) return absl::InvalidArgumentError("the call has two logins");
      return check_login(method, std::string(first->second.data(), first->second.size()), caller);
    }
    if (!shows_certificate(caller)) return absl::OkStatus();
    return admit(method, roles_of(caller), name_of(caller));
  }

  absl::Status check_login(std::string_view method, const std::string& login,
                           const grpc::AuthContext& caller) const {
    const Roles roles = roles_of(caller);
    if (shows_certificate(caller) && (roles & only(Role::kConsole)) == 0) {
      spdlog::warn("audit refused rpc={} caller=\"{}\" roles={} with=login", method, name_of(caller),
                   names_of(roles));
      return absl::PermissionDeniedError(
          fmt::format("calls with a login are for the role console; \"{}\" has {}", name_of(caller),
                      names_of(roles, ", ")));
    }
    if (principal_of_ == nullptr)
      return absl::PermissionDeniedError("only the server takes calls with a login");
    GW_ASSIGN_OR_RETURN(const Principal principal, principal_of_(login));
    return admit(method, principal.roles, principal.title());
  }

  const PrincipalOf principal_of_;
};

}  // namespace

std::shared_ptr<grpc::AuthMetadataProcessor> role_gate(PrincipalOf principal_of) {
  return std::make_shared<RoleGate>(std::move(principal_of));
}

}  // namespace glasswing
