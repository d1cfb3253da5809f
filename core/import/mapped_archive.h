// The frames of an archive on this machine, memory-mapped: pages are loaded on access and evicted when memory
// is short; nothing is copied.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "core/frame/image.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

class MappedArchive {
 public:
  // Verifies every frame. DATA_LOSS names a frame file that is missing, has the wrong size or format, or does
  // not match its checksum in the manifest.
  static absl::StatusOr<std::shared_ptr<const MappedArchive>> open(const std::filesystem::path& directory);
  // The same, with all colours at each pixel: frames of a mosaic are interpolated, in memory.
  static absl::StatusOr<std::shared_ptr<const MappedArchive>> open_interpolated(
      const std::filesystem::path& directory);
  ~MappedArchive();
  MappedArchive(const MappedArchive&) = delete;
  MappedArchive& operator=(const MappedArchive&) = delete;

  const v1::CaptureManifest& manifest() const { return manifest_; }
  // The samples of rows [first_row, first_row + row_count) of a frame, by its index in the manifest.
  std::span<const std::uint16_t> rows(int frame, int first_row, int row_count) const;

 private:
  MappedArchive() = default;
  static absl::StatusOr<std::shared_ptr<MappedArchive>> map(const std::filesystem::path& directory);

  v1::CaptureManifest manifest_;
  std::vector<void*> mappings_;
  size_t file_bytes_ = 0;
  std::vector<Image16> interpolated_;  // by frame, if they are not as they were stored
};

}  // namespace glasswing
