#include "core/security/tls_reload.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kInterval{1};

}  // namespace

absl::Status MemoryFile::replace(const std::string& bytes) {
  const int fd = ::memfd_create("glasswing-tls", MFD_CLOEXEC);
  // gRPC compares modification times, in seconds, to detect files that change while it reads them.
  const timespec version{++version_, 0};
  const timespec times[] = {version, version};
  const bool written = fd >= 0 &&
                       ::write(fd, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size()) &&
                       ::futimens(fd, times) == 0 && (fd_ < 0 || ::dup3(fd, fd_, O_CLOEXEC) >= 0);
  const int error_number = errno;
  if (written && fd_ < 0) {
    fd_ = fd;
  } else if (fd >= 0) {
    ::close(fd);
  }
  return written ? absl::OkStatus() : absl::ErrnoToStatus(error_number, "cannot keep certificates in memory");
}

std::string MemoryFile::path() const {
  return fmt::format("/proc/self/fd/{}", fd_);
}

absl::StatusOr<std::unique_ptr<TlsReload>> TlsReload::start(const TlsFiles& files,
                                                            const TlsMaterial& material) {
  using grpc::experimental::FileWatcherCertificateProvider;
  std::unique_ptr<TlsReload> self(new TlsReload(files));
  GW_RETURN_IF_ERROR(self->publish(material));
  // gRPC 1.51 has no provider for changing data in memory, and its file provider accepts a key without its
  // certificate, a missing file or a broken one, and then refuses every connection. So it watches copies in
  // memory, key and certificate in one file, that hold only what has been checked.
  constexpr unsigned kRefresh_s = 1;
  const std::string ca = self->ca_.path();
  if (material.key.empty()) {
    self->provider_ = std::make_shared<FileWatcherCertificateProvider>(ca, kRefresh_s);
  } else {
    const std::string identity = self->identity_.path();
    self->provider_ = std::make_shared<FileWatcherCertificateProvider>(identity, identity, ca, kRefresh_s);
  }
  self->thread_ = std::jthread([reload = self.get()](std::stop_token stop) { reload->run(std::move(stop)); });
  return self;
}

TlsReload::~TlsReload() = default;

absl::Status TlsReload::publish(const TlsMaterial& material) {
  if (material.ca != in_force_.ca) GW_RETURN_IF_ERROR(ca_.replace(material.ca));
  if (material.key != in_force_.key || material.certificate != in_force_.certificate)
    GW_RETURN_IF_ERROR(identity_.replace(material.key + material.certificate));
  in_force_ = material;
  return absl::OkStatus();
}

TlsMaterial TlsReload::in_force() {
  const std::lock_guard lock(mutex_);
  return in_force_;
}

void TlsReload::look() {
  const absl::StatusOr<TlsMaterial> read = read_tls_material(files_);
  const bool changed = read.ok() && *read != in_force_;
  const absl::Status problem = changed ? publish(*read) : read.status();
  if (changed && problem.ok())
    spdlog::info("certificates taken up ca={} certificate={}", files_.ca, files_.certificate);
  // Only when seen twice: files that are being replaced are wrong for a moment.
  if (!problem.ok() && problem == seen_ && problem != logged_)
    spdlog::warn("the certificates stay as they were: {}", std::string(problem.message()));
  logged_ = problem == seen_ ? problem : logged_;
  seen_ = problem;
}

void TlsReload::run(std::stop_token stop) {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait_for(lock, stop, kInterval, [] { return false; });
    if (stop.stop_requested()) return;
    look();
  }
}

}  // namespace glasswing
