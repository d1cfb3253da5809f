// A lab's own certificate authority, in a directory: ca.pem and ca.key, and NAME.pem and NAME.key for each
// issued certificate. Keys are on P-256 and readable only by their owner. Files are written atomically. An
// open authority is locked: other processes wait.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/pki/certificate_request.h"
#include "core/security/pem.h"

namespace glasswing {

struct IssuedCertificate {
  CertificateRequest of;
  std::chrono::sys_seconds valid_until;
};

class CertificateAuthority {
 public:
  static constexpr int kMaxDays = 3650;  // validity of its own certificate

  // Makes the directory and a new authority, `name` being its certificate's common name. ALREADY_EXISTS:
  // there is one, or part of one. Or the system's error.
  static absl::StatusOr<CertificateAuthority> init(const std::filesystem::path& directory,
                                                   const std::string& name);
  // NOT_FOUND: there is no authority. INVALID_ARGUMENT: ca.pem is not a certificate.
  static absl::StatusOr<CertificateAuthority> open(const std::filesystem::path& directory);

  // ALREADY_EXISTS: there are files for this name.
  absl::Status check_free(const std::string& name) const;
  // Makes a key and a certificate for client and server use, valid from an hour ago (for slow clocks) for
  // `days` from now. Errors: as check_free(). NOT_FOUND: ca.key is missing. INVALID_ARGUMENT: it does not
  // belong to ca.pem, or the authority expires earlier.
  absl::StatusOr<IssuedCertificate> issue(const CertificateRequest& request, int days) const;
  // Replaces the certificate and key with new ones for the same roles and hosts. NOT_FOUND: it issued none
  // with this name. Other errors: as issue().
  absl::StatusOr<IssuedCertificate> renew(const std::string& name, int days) const;
  // The certificates in the directory that it signed, sorted by name.
  absl::StatusOr<std::vector<IssuedCertificate>> issued() const;

  std::string name() const;
  std::chrono::sys_seconds valid_until() const { return end_of(*certificate_); }

 private:
  CertificateAuthority(std::filesystem::path directory, std::shared_ptr<const void> lock)
      : directory_(std::move(directory)), lock_(std::move(lock)) {}
  std::filesystem::path file(const std::string& name, const char* ending) const {
    return directory_ / (name + ending);
  }
  // Null if this authority did not sign it.
  absl::StatusOr<Certificate> find(const std::string& name) const;
  absl::StatusOr<IssuedCertificate> sign(const std::string& name, const X509_NAME& subject,
                                         X509_EXTENSION& names, int days) const;

  std::filesystem::path directory_;
  std::shared_ptr<const void> lock_;
  Certificate certificate_;
};

}  // namespace glasswing
