// Reloads certificates for gRPC when their files change.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/security/tls_certificate_provider.h>

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

#include "core/security/tls_files.h"

namespace glasswing {

// A file in memory whose content is replaced atomically. Never closed: gRPC may read its path for as long as
// the process lives.
class MemoryFile {
 public:
  absl::Status replace(const std::string& bytes);
  std::string path() const;

 private:
  int fd_ = -1;
  std::int64_t version_ = 0;
};

// Reads the files every second. New connections use a change a second later; open ones continue. Files that
// read_tls_material() refuses, such as a certificate whose key is not there yet, change nothing, and are
// logged once.
class TlsReload {
 public:
  // `material`: the current content of `files`, with a CA. Fails with the system's error.
  static absl::StatusOr<std::unique_ptr<TlsReload>> start(const TlsFiles& files, const TlsMaterial& material);
  ~TlsReload();

  const std::shared_ptr<grpc::experimental::CertificateProviderInterface>& provider() const {
    return provider_;
  }
  TlsMaterial in_force();

 private:
  explicit TlsReload(const TlsFiles& files) : files_(files) {}
  absl::Status publish(const TlsMaterial& material);
  void look();
  void run(std::stop_token stop);

  const TlsFiles files_;
  MemoryFile ca_, identity_;
  TlsMaterial in_force_;
  absl::Status seen_, logged_;  // the files' last problem, and the last one logged
  std::shared_ptr<grpc::experimental::CertificateProviderInterface> provider_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace glasswing
