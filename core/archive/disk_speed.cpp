#include "core/archive/disk_speed.h"

#include <algorithm>
#include <random>
#include <string>

#include "core/base/status.h"
#include "core/file/positioned_file.h"

namespace glasswing {
namespace {

constexpr std::uint64_t kPiece_bytes = 4 << 20, kMaxWritten_bytes = 64 << 20;
constexpr nanoseconds kMaxTime = std::chrono::milliseconds(500);

}  // namespace

absl::StatusOr<std::int64_t> measured_write_speed(const std::filesystem::path& directory) {
  GW_ASSIGN_OR_RETURN(PositionedFile file, PositionedFile::create_unnamed(directory));
  std::string piece(kPiece_bytes, '\0');
  std::mt19937_64 random(1);  // some disks compress
  for (size_t at = 0; at < piece.size(); at += sizeof(std::uint64_t)) {
    const std::uint64_t value = random();
    std::copy_n(reinterpret_cast<const char*>(&value), sizeof value, &piece[at]);
  }
  const nanoseconds began = monotonic_now();
  std::uint64_t written = 0;
  nanoseconds took{};
  while (written < kMaxWritten_bytes && took < kMaxTime) {
    GW_RETURN_IF_ERROR(file.write_at(written, piece));
    GW_RETURN_IF_ERROR(file.flush());
    written += piece.size();
    took = monotonic_now() - began;
  }
  const double seconds = std::chrono::duration<double>(std::max(took, nanoseconds(1))).count();
  return static_cast<std::int64_t>(static_cast<double>(written) / seconds);
}

absl::StatusOr<std::int64_t> DiskSpeed::write_bytes_per_second() {
  const std::lock_guard lock(mutex_);
  const nanoseconds now = now_();
  if (!measured_ || now - measured_at_ > kMaxAge) {
    measured_.reset();
    GW_ASSIGN_OR_RETURN(measured_, measure_(directory_));
    measured_at_ = now;
  }
  return *measured_;
}

}  // namespace glasswing
