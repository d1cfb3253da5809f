// The owner of a certificate that a peer showed in the TLS handshake.
#pragma once

#include <grpcpp/security/auth_context.h>
#include <openssl/x509.h>

#include <chrono>
#include <optional>
#include <string>

#include "core/security/roles.h"

namespace glasswing {

struct CertifiedPeer {
  std::string name;  // the certificate's common name
  Roles roles = 0;
  std::chrono::sys_seconds expires = {};
};

CertifiedPeer peer_of(const X509& certificate);
// Null: the peer showed no certificate, as on a connection without TLS.
std::optional<CertifiedPeer> peer_of(const grpc::AuthContext& context);

bool shows_certificate(const grpc::AuthContext& context);
// Cheaper than peer_of(): without a certificate, the name is empty and there are no roles.
std::string name_of(const grpc::AuthContext& context);
Roles roles_of(const grpc::AuthContext& context);

}  // namespace glasswing
