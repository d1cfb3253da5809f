// The files that TLS needs, and their content once it has been checked.
#pragma once

#include <absl/status/statusor.h>

#include <string>

namespace glasswing {

// PEM files; empty: none.
struct TlsFiles {
  std::string ca;           // signs the peers' certificates; holds several CAs while a lab replaces its own
  std::string certificate;  // this program's own
  std::string key;          // of that certificate, without a passphrase
};

// In PEM; empty: there is no such file.
struct TlsMaterial {
  std::string ca;
  std::string certificate;  // with the intermediate ones up to the CA
  std::string key;

  bool operator==(const TlsMaterial&) const = default;
};

// INVALID_ARGUMENT names the file that cannot be read, is not PEM, has expired, or lacks its partner.
absl::StatusOr<TlsMaterial> read_tls_material(const TlsFiles& files);

}  // namespace glasswing
