#include "core/security/peer.h"

#include <grpc/grpc_security_constants.h>

#include <vector>

#include "core/security/pem.h"

namespace glasswing {

CertifiedPeer peer_of(const X509& certificate) {
  CertifiedPeer peer{.name = "", .expires = end_of(certificate)};
  const X509_NAME* subject = X509_get_subject_name(&certificate);
  if (const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1); at >= 0)
    peer.name = text_of(*X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
  const AltNames names = alt_names_of(certificate);
  for (int i = 0; i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME& each = *sk_GENERAL_NAME_value(names.get(), i);
    if (each.type == GEN_URI) peer.roles |= role_of_uri(text_of(*each.d.uniformResourceIdentifier));
  }
  return peer;
}

Roles roles_of(const grpc::AuthContext& caller) {
  Roles roles = 0;
  for (const grpc::string_ref& uri : caller.FindPropertyValues(GRPC_PEER_URI_PROPERTY_NAME))
    roles |= role_of_uri({uri.data(), uri.size()});
  return roles;
}

std::string name_of(const grpc::AuthContext& caller) {
  const std::vector<grpc::string_ref> names = caller.FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME);
  return names.empty() ? "" : std::string(names.front().data(), names.front().size());
}

bool shows_certificate(const grpc::AuthContext& caller) {
  return !caller.FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME).empty();
}

std::optional<CertifiedPeer> peer_of(const grpc::AuthContext& context) {
  const std::vector<grpc::string_ref> pem = context.FindPropertyValues(GRPC_X509_PEM_CERT_PROPERTY_NAME);
  if (pem.empty()) return std::nullopt;
  const std::vector<Certificate> shown = certificates_in(std::string(pem.front().data(), pem.front().size()));
  if (shown.empty()) return std::nullopt;
  return peer_of(*shown.front());
}

}  // namespace glasswing
