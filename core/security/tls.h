// TLS between programs: the CA that peers' certificates must be signed by, and this program's own
// certificate.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "core/security/login.h"
#include "core/security/roles.h"
#include "core/security/tls_files.h"

namespace glasswing {

// Sets what dial() and ServiceHost use from now on, in the whole process: TLS to every peer if `ca` is given,
// and from every caller if `certificate` and `key` are too; otherwise none. Files that change later are
// reloaded (tls_reload.h). INVALID_ARGUMENT names the file that cannot be read, is not PEM, has expired, or
// lacks its partner; if ignored, every later call fails with this status.
absl::Status use_tls(const TlsFiles& files);

// The files in force; empty without TLS. For listeners other than gRPC's.
TlsMaterial tls_material();

// True if host:port is on this machine, and so may be called without TLS.
bool is_loopback(const std::string& address);

// For calls to host:port. With TLS the handshake fails unless the peer's certificate has the host's name and,
// if `roles` is not 0, one of these roles: no call reaches it then. Null if calls need TLS and there is none:
// gRPC then fails every call with INVALID_ARGUMENT.
std::shared_ptr<grpc::ChannelCredentials> credentials_for(const std::string& address, Roles roles = 0);

// For listening on host:port. With all three files callers must use TLS and show a certificate signed by
// `ca`; calls pass the role gate (role_gate.h), of which `principal_of` is part. INVALID_ARGUMENT: there is a
// problem with the files, or one is missing and the address is not loopback.
absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> listening_credentials(
    const std::string& address, PrincipalOf principal_of = nullptr);

// If TLS is why a call never reached `peer`: one sentence that says what to set. Empty otherwise.
std::string tls_failure(const grpc::Status& status, const std::string& peer);

}  // namespace glasswing
