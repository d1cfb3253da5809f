#include "core/security/tls_files.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/security/pem.h"

namespace glasswing {
namespace {

absl::StatusOr<std::string> read_pem(const char* what, const std::string& path) {
  absl::StatusOr<std::string> pem = read_file(path);
  if (pem.ok()) return pem;
  return absl::InvalidArgumentError(
      fmt::format("the {} cannot be read: {}", what, std::string(pem.status().message())));
}

bool has_expired(const Certificate& certificate) {
  return X509_cmp_current_time(X509_get0_notAfter(certificate.get())) < 0;
}

absl::StatusOr<std::vector<Certificate>> read_certificates(const char* what, const std::string& path) {
  GW_ASSIGN_OR_RETURN(const std::string pem, read_pem(what, path));
  std::vector<Certificate> certificates = certificates_in(pem);
  if (!certificates.empty()) return certificates;
  return absl::InvalidArgumentError(fmt::format("the {} is {}; it must be a certificate in PEM", what, path));
}

std::string pem_of_all(const std::vector<Certificate>& certificates) {
  std::string pem;
  for (const Certificate& certificate : certificates) pem += pem_of(*certificate);
  return pem;
}

absl::Status check_complete(const TlsFiles& files) {
  if (files.certificate.empty() != files.key.empty()) {
    return absl::InvalidArgumentError(
        files.key.empty() ? fmt::format("the certificate {} lacks its key; set --key", files.certificate)
                          : fmt::format("the key {} lacks its certificate; set --certificate", files.key));
  }
  if (!files.ca.empty() || files.certificate.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "the certificate {} lacks the CA that signs those of the peers; set --ca", files.certificate));
}

}  // namespace

absl::StatusOr<TlsMaterial> read_tls_material(const TlsFiles& files) {
  GW_RETURN_IF_ERROR(check_complete(files));
  TlsMaterial material;
  if (files.ca.empty()) return material;
  GW_ASSIGN_OR_RETURN(const std::vector<Certificate> authorities, read_certificates("CA", files.ca));
  if (std::ranges::all_of(authorities, has_expired))
    return absl::InvalidArgumentError(fmt::format("the CA {} has expired", files.ca));
  material.ca = pem_of_all(authorities);
  if (files.certificate.empty()) return material;

  GW_ASSIGN_OR_RETURN(const std::vector<Certificate> chain,
                      read_certificates("certificate", files.certificate));
  GW_ASSIGN_OR_RETURN(const std::string key_pem, read_pem("key", files.key));
  const PrivateKey key = private_key_in(key_pem);
  if (key == nullptr) {
    return absl::InvalidArgumentError(
        fmt::format("the key is {}; it must be a private key in PEM, without a passphrase", files.key));
  }
  if (has_expired(chain.front()))
    return absl::InvalidArgumentError(fmt::format("the certificate {} has expired", files.certificate));
  if (X509_check_private_key(chain.front().get(), key.get()) != 1) {
    return absl::InvalidArgumentError(
        fmt::format("the key {} does not belong to the certificate {}", files.key, files.certificate));
  }
  material.certificate = pem_of_all(chain);
  material.key = pem_of(*key);
  return material;
}

}  // namespace glasswing
