// Room on a disk for frames, of which some stays free whatever is captured: a disk that is full to the last
// byte takes other programs down with it, and the log that would say why.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>

namespace glasswing {

// What the system says of the disk that holds a directory.
using SpaceOf = std::function<absl::StatusOr<std::filesystem::space_info>(const std::filesystem::path&)>;
absl::StatusOr<std::filesystem::space_info> space_of(const std::filesystem::path& directory);

class DiskRoom {
 public:
  // `reserve_bytes` stay free; if left out 2 % of the disk but at least 1 GB, or a tenth of a disk on which
  // that is less.
  explicit DiskRoom(std::filesystem::path directory, std::optional<std::int64_t> reserve_bytes = 0,
                    SpaceOf space = space_of)
      : directory_(std::move(directory)), reserve_bytes_(reserve_bytes), space_(std::move(space)) {}

  struct Room {
    std::int64_t free_bytes = 0;  // for frames, without the reserve; never below 0
    std::int64_t total_bytes = 0;
    std::int64_t reserve_bytes = 0;
  };
  absl::StatusOr<Room> room() const;
  // RESOURCE_EXHAUSTED: there is no room for so many; says how much is missing, and where.
  absl::Status check(std::int64_t bytes) const;

 private:
  std::filesystem::path directory_;
  std::optional<std::int64_t> reserve_bytes_;
  SpaceOf space_;
};

}  // namespace glasswing
