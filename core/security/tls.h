// TLS between programs: whose signature on a peer's certificate counts, and which certificate is this
// program's own.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

#include "core/security/tls_files.h"

namespace glasswing {

// What dial() and ServiceHost use from now on, in the whole process: TLS to every peer if `ca` is given, and
// from every caller if `certificate` and `key` are too, else none. One program speaks for one user. Files
// that change later are taken up (tls_reload.h). INVALID_ARGUMENT names the file that cannot be read, is no
// PEM, has expired, or lacks its partner; who goes on all the same gets this answer to every call.
absl::Status use_tls(const TlsFiles& files);

// What is in force now; empty without TLS. For who listens by other means than gRPC.
TlsMaterial tls_material();

// Whether host:port is this machine, and so may be called without TLS.
bool is_loopback(const std::string& address);

// For calls to host:port; null where they need TLS and have none, for which gRPC answers every call with
// INVALID_ARGUMENT.
std::shared_ptr<grpc::ChannelCredentials> credentials_for(const std::string& address);

// For listening on host:port. With all three files callers must speak TLS and show a certificate that `ca`
// signed. INVALID_ARGUMENT: the files have a problem, or lack one and the address is beyond this machine.
absl::StatusOr<std::shared_ptr<grpc::ServerCredentials>> listening_credentials(const std::string& address);

// Why a call that never reached `peer` failed, if the cause is TLS: one sentence that says what to set; else
// empty.
std::string tls_failure(const grpc::Status& status, const std::string& peer);

}  // namespace glasswing
