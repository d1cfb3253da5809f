// The files that TLS needs, and what they hold once it is known to be good.
#pragma once

#include <absl/status/statusor.h>

#include <string>

namespace glasswing {

// PEM files; empty: none.
struct TlsFiles {
  std::string ca;           // that signed the certificates of the peers; several while a lab changes its own
  std::string certificate;  // this program's own, which peers may ask for
  std::string key;          // that belongs to it, without a passphrase
};

// In PEM; empty: there is no such file.
struct TlsMaterial {
  std::string ca;
  std::string certificate;  // and those between it and the CA
  std::string key;

  bool operator==(const TlsMaterial&) const = default;
};

// INVALID_ARGUMENT names the file that cannot be read, is no PEM, has expired, or lacks its partner.
absl::StatusOr<TlsMaterial> read_tls_material(const TlsFiles& files);

}  // namespace glasswing
