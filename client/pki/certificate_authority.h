// A lab's own certificate authority, in a directory: ca.pem and ca.key, and of each name that it issued a
// certificate for, NAME.pem and NAME.key. Keys are on P-256 and can be read by their owner only; files are
// whole or not there. Others wait as long as somebody has it open.
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
  static constexpr int kMaxDays = 3650;  // that its own certificate is valid

  // Makes a new one, whose certificate says `name`, and the directory. ALREADY_EXISTS: there is one, or the
  // half of one. Also the system's own error.
  static absl::StatusOr<CertificateAuthority> init(const std::filesystem::path& directory,
                                                   const std::string& name);
  // NOT_FOUND: there is none. INVALID_ARGUMENT: its certificate is none.
  static absl::StatusOr<CertificateAuthority> open(const std::filesystem::path& directory);

  // OK, or ALREADY_EXISTS: there are files of that name.
  absl::Status check_free(const std::string& name) const;
  // A new key, and a certificate for client and server that is valid for `days` from now, and an hour back,
  // for clocks that are slow. As check_free(); NOT_FOUND: its key is not there; INVALID_ARGUMENT: it is
  // another's, or the authority does not live that long.
  absl::StatusOr<IssuedCertificate> issue(const CertificateRequest& request, int days) const;
  // The same certificate with a new key, in the place of the old ones. NOT_FOUND: it issued none of that
  // name. Else as issue().
  absl::StatusOr<IssuedCertificate> renew(const std::string& name, int days) const;
  // What is in the directory and signed by it, by name.
  absl::StatusOr<std::vector<IssuedCertificate>> issued() const;

  std::string name() const;
  std::chrono::sys_seconds valid_until() const { return end_of(*certificate_); }

 private:
  CertificateAuthority(std::filesystem::path directory, std::shared_ptr<const void> lock)
      : directory_(std::move(directory)), lock_(std::move(lock)) {}
  std::filesystem::path file(const std::string& name, const char* ending) const {
    return directory_ / (name + ending);
  }
  // Null where it is not this authority's.
  absl::StatusOr<Certificate> find(const std::string& name) const;
  absl::StatusOr<IssuedCertificate> sign(const std::string& name, const X509_NAME& subject,
                                         X509_EXTENSION& names, int days) const;

  std::filesystem::path directory_;
  std::shared_ptr<const void> lock_;
  Certificate certificate_;
};

}  // namespace glasswing
