#include "server/dispatch/lease_seal.h"

#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include <array>

#include "core/base/status.h"

namespace glasswing {

absl::StatusOr<std::string> LeaseSeal::secret_of(const std::string& caller, const v1::TileLease& lease) {
  const std::lock_guard lock(mutex_);
  if (key_.empty()) {
    GW_ASSIGN_OR_RETURN(key_, jobs_.lease_key());
  }
  const std::string what =
      fmt::format("{} {} {} {}\n{}", lease.job(), lease.tile(), lease.attempt(), lease.session(), caller);
  std::array<unsigned char, EVP_MAX_MD_SIZE> code{};
  unsigned int size = 0;
  HMAC(EVP_sha256(), key_.data(), static_cast<int>(key_.size()),
       reinterpret_cast<const unsigned char*>(what.data()), what.size(), code.data(), &size);
  std::string secret;
  for (unsigned int i = 0; i < size; ++i) secret += fmt::format("{:02x}", code[i]);
  return secret;
}

absl::Status LeaseSeal::seal(const std::string& caller, v1::TileLease& lease) {
  GW_ASSIGN_OR_RETURN(*lease.mutable_secret(), secret_of(caller, lease));
  return absl::OkStatus();
}

absl::Status LeaseSeal::check(const std::string& caller, const v1::TileLease& lease) {
  GW_ASSIGN_OR_RETURN(const std::string secret, secret_of(caller, lease));
  if (lease.secret().size() == secret.size() &&
      CRYPTO_memcmp(lease.secret().data(), secret.data(), secret.size()) == 0)
    return absl::OkStatus();
  return absl::AbortedError(fmt::format("attempt {} at tile {} of job {} was not handed out to this caller",
                                        lease.attempt(), lease.tile(), lease.job()));
}

}  // namespace glasswing
