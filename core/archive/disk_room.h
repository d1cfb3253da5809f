// Disk space for frames, with a reserve that always stays free: a completely full disk breaks other programs
// and the log.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

namespace glasswing {

// The space of the disk that holds a directory.
using SpaceOf = std::function<absl::StatusOr<std::filesystem::space_info>(const std::filesystem::path&)>;
absl::StatusOr<std::filesystem::space_info> space_of(const std::filesystem::path& directory);

class DiskRoom {
 public:
  // `reserve_bytes` stay free; nullopt: 2 % of the disk, at least 1 GB, but at most a tenth of the disk.
  explicit DiskRoom(std::filesystem::path directory, std::optional<std::int64_t> reserve_bytes = 0,
                    SpaceOf space = space_of)
      : directory_(std::move(directory)), reserve_bytes_(reserve_bytes), space_(std::move(space)) {}

  struct Room {
    std::int64_t free_bytes = 0;  // for frames, without the reserve; never below 0
    std::int64_t total_bytes = 0;
    std::int64_t reserve_bytes = 0;
  };
  absl::StatusOr<Room> room() const;
  // RESOURCE_EXHAUSTED: not enough space for `bytes`; says how much is missing, and where.
  absl::Status check(std::int64_t bytes) const;

 private:
  std::filesystem::path directory_;
  std::optional<std::int64_t> reserve_bytes_;
  SpaceOf space_;
};

}  // namespace glasswing
