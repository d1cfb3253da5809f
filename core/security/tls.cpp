#include "core/security/tls.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <grpcpp/security/tls_credentials_options.h>

#include <functional>

#include "core/base/address.h"
#include "core/base/status.h"
#include "core/security/peer.h"
#include "core/security/pem.h"
#include "core/security/role_gate.h"
#include "core/security/roles.h"
#include "core/security/tls_reload.h"

namespace glasswing {
namespace {

constexpr char kRoleFailure[] = "its certificate's roles: ";

struct Tls {
  TlsFiles files = {};
  bool shows_certificate = false;               // to those that it calls, and that call it
  std::unique_ptr<TlsReload> reload = nullptr;  // null: no TLS
  absl::Status problem = {};                    // with the files
};

Tls& in_force() {
  static Tls tls;
  return tls;
}

// No `reload` without a CA.
absl::StatusOr<Tls> credentials_of(const TlsFiles& files) {
  GW_ASSIGN_OR_RETURN(const TlsMaterial material, read_tls_material(files));
  Tls made{.files = files};
  if (material.ca.empty()) return made;
  GW_ASSIGN_OR_RETURN(made.reload, TlsReload::start(files, material));
  made.shows_certificate = !material.key.empty();
  return made;
}

// The peer's host name, as without it, and one of its certificate's roles.
class RoleVerifier final : public grpc::experimental::ExternalCertificateVerifier {
 public:
  explicit RoleVerifier(Roles roles) : roles_(roles) {}

  bool Verify(grpc::experimental::TlsCustomVerificationCheckRequest* request,
              std::function<void(grpc::Status)>, grpc::Status* verdict) override {
    host_.Verify(request, nullptr, verdict);
    if (!verdict->ok()) return true;
    const grpc::string_ref pem = request->peer_cert();
    const std::vector<Certificate> shown = certificates_in(std::string(pem.data(), pem.size()));
    const CertifiedPeer peer = shown.empty() ? CertifiedPeer{} : peer_of(*shown.front());
    if ((peer.roles & roles_) == 0) {
      *verdict = {grpc::StatusCode::UNAUTHENTICATED,
                  fmt::format("{}{}; it must have: {}", kRoleFailure, names_of(peer.roles),
                              names_of(roles_, " or "))};
    }
    return true;
  }
  void Cancel(grpc::experimental::TlsCustomVerificationCheckRequest*) override {}

 private:
  const Roles roles_;
  grpc::experimental::HostNameCertificateVerifier host_;
};

bool contains(const std::string& text, const char* words) {
  return text.find(words) != std::string::npos;
}

// Empty: it is not an address.
std::string host_of(const std::string& address) {
  const absl::StatusOr<Address> parsed = parse_address(address);
  return parsed.ok() ? parsed->host : "";
}

}  // namespace

absl::Status use_tls(const TlsFiles& files) {
  absl::StatusOr<Tls> tls = credentials_of(files);
  const absl::Status problem = tls.status();
  in_force() = tls.ok() ? *std::move(tls) : Tls{.files = files, .problem = problem};
  return problem;
}

TlsMaterial tls_material() {
  return in_force().reload == nullptr ? TlsMaterial{} : in_force().reload->in_force();
}

bool is_loopback(const std::string& address) {
  const std::string host = host_of(address);
  in_addr ip{};
  if (::inet_pton(AF_INET, host.c_str(), &ip) == 1) return ntohl(ip.s_addr) >> 24 == 127;
  return host == "localhost" || host == "::1";
}

std::shared_ptr<grpc::ChannelCredentials> credentials_for(const std::string& address, Roles roles) {
  const Tls& tls = in_force();
  if (tls.reload != nullptr) {
    // Created each time: gRPC's options belong to the credentials created from them.
    grpc::experimental::TlsChannelCredentialsOptions options;
    options.set_certificate_provider(tls.reload->provider());
    options.watch_root_certs();
    if (tls.shows_certificate) options.watch_identity_key_cert_pairs();
    if (roles != 0) {
      options.set_certificate_verifier(
          grpc::experimental::ExternalCertificateVerifier::Create<RoleVerifier>(roles));
    }
    return grpc::experimental::TlsCredentials(options);
  }
  return is_loopback(address) && in_force().problem.ok() ? grpc::InsecureChannelCredentials() : nullptr;
}

absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> listening_credentials(const std::string& address,
                                                                               PrincipalOf principal_of) {
  const Tls& tls = in_force();
  GW_RETURN_IF_ERROR(tls.problem);
  if (const absl::Status parsed = parse_address(address).status(); !parsed.ok())
    return absl::InvalidArgumentError(fmt::format("--listen: {}", std::string(parsed.message())));
  std::shared_ptr<grpc::ServerCredentials> made;
  if (tls.shows_certificate) {
    grpc::experimental::TlsServerCredentialsOptions options(tls.reload->provider());
    options.watch_root_certs();
    options.watch_identity_key_cert_pairs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
    made = grpc::experimental::TlsServerCredentials(options);
  } else if (!is_loopback(address)) {
    return absl::InvalidArgumentError(
        fmt::format("--listen is {}, which other machines reach: they need TLS; set --ca, --certificate and "
                    "--key, or listen on "
                    "127.0.0.1:PORT",
                    address));
  } else if (principal_of == nullptr) {
    return grpc::InsecureServerCredentials();
  } else if (const std::string host = host_of(address); host.starts_with("127.") && host != "127.0.0.1") {
    return absl::InvalidArgumentError(fmt::format(
        "--listen is {}; without TLS it must be 127.0.0.1:PORT, [::1]:PORT or localhost:PORT", address));
  } else {
    // In the clear too, but with a gate. gRPC takes no other address of 127.0.0.0/8 for this machine.
    made = grpc::experimental::LocalServerCredentials(LOCAL_TCP);
  }
  made->SetAuthMetadataProcessor(role_gate(std::move(principal_of)));
  return made;
}

std::string tls_failure(const grpc::Status& status, const std::string& peer) {
  const std::string& words = status.error_message();
  const TlsFiles& files = in_force().files;
  if (status.error_code() == grpc::StatusCode::INVALID_ARGUMENT && words == "Invalid credentials.") {
    if (!in_force().problem.ok()) return std::string(in_force().problem.message());
    return peer + " is beyond this machine, where calls need TLS; set --ca, and --certificate and --key";
  }
  if (status.error_code() != grpc::StatusCode::UNAVAILABLE || !contains(words, "failed to connect"))
    return "";
  if (files.ca.empty()) {
    if (!contains(words, "Socket closed")) return "";  // a TLS server closes plain connections
    return peer + " does not answer in the clear; if it speaks TLS, set --ca, --certificate and --key";
  }
  if (contains(words, "certificate verify failed")) {
    return fmt::format("{} shows a certificate that the CA {} did not sign, or that has expired", peer,
                       files.ca);
  }
  if (const size_t at = words.find(kRoleFailure); at != std::string::npos)
    return fmt::format("{} is not what it should be; {}", peer,
                       words.substr(at, words.find_first_of("]}\n", at) - at));
  if (contains(words, "Hostname Verification Check failed"))
    return peer + " shows a certificate of another host; call it by a name that its certificate has";
  if (contains(words, "wrong version number"))
    return peer + " does not speak TLS; if it need not, call it without a CA";
  if (!contains(words, "Socket closed")) return "";
  // gRPC reports no more than this when the peer refuses our certificate.
  return files.certificate.empty()
             ? peer + " wants to know who calls; set --certificate and --key"
             : fmt::format("{} refuses the certificate {}; its own CA must have signed it", peer,
                           files.certificate);
}

}  // namespace glasswing
