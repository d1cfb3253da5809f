#include "core/archive/disk_room.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr double kMegabyte = 1e6;
constexpr std::int64_t kMinReserve = 1'000'000'000;

std::int64_t usual_reserve(std::int64_t total_bytes) {
  return std::min(std::max(total_bytes / 50, kMinReserve), total_bytes / 10);
}

}  // namespace

absl::StatusOr<std::filesystem::space_info> space_of(const std::filesystem::path& directory) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(directory, error);
  if (!error) return space;
  return absl::ErrnoToStatus(error.value(), "cannot determine the space below " + directory.string());
}

absl::StatusOr<DiskRoom::Room> DiskRoom::room() const {
  GW_ASSIGN_OR_RETURN(const std::filesystem::space_info space, space_(directory_));
  Room room{.free_bytes = 0, .total_bytes = static_cast<std::int64_t>(space.capacity), .reserve_bytes = 0};
  room.reserve_bytes = reserve_bytes_.value_or(usual_reserve(room.total_bytes));
  room.free_bytes =
      std::max(static_cast<std::int64_t>(space.available) - room.reserve_bytes, std::int64_t{0});
  return room;
}

absl::Status DiskRoom::check(std::int64_t bytes) const {
  const absl::StatusOr<Room> now = room();
  if (!now.ok() || bytes <= now->free_bytes) return absl::OkStatus();  // if unknown, the write will fail
  return absl::ResourceExhaustedError(fmt::format(
      "{:.1f} MB are missing in {}: {:.1f} MB are to be stored, {:.1f} MB are free, excluding the "
      "reserve of {:.1f} MB",
      static_cast<double>(bytes - now->free_bytes) / kMegabyte, directory_.string(),
      static_cast<double>(bytes) / kMegabyte, static_cast<double>(now->free_bytes) / kMegabyte,
      static_cast<double>(now->reserve_bytes) / kMegabyte));
}

}  // namespace glasswing
