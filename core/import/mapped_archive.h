// The frames of an archive on this machine, memory-mapped: pages are loaded on access and evicted when memory
// is short. Rows of plain files are used in place; those of compressed ones are decompressed on request.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string_view>
#include <vector>

#include "core/image/image.h"
#include "core/image/tiff.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct FrameSamples {
  std::span<const std::uint16_t> samples;
  std::shared_ptr<const std::uint16_t[]> owner;  // null: they lie in a mapped file
};

class MappedArchive {
 public:
  // Verifies every frame. DATA_LOSS names a frame file that is missing, has the wrong size or format, or does
  // not match its checksum in the manifest.
  static absl::StatusOr<std::shared_ptr<const MappedArchive>> open(const std::filesystem::path& directory);
  // The same, with all colours at each pixel. Frames of a mosaic are interpolated, in memory, which also
  // holds compressed frames.
  static absl::StatusOr<std::shared_ptr<const MappedArchive>> open_interpolated(
      const std::filesystem::path& directory);
  ~MappedArchive();
  MappedArchive(const MappedArchive&) = delete;
  MappedArchive& operator=(const MappedArchive&) = delete;

  const v1::CaptureManifest& manifest() const { return manifest_; }
  // The samples of rows [first_row, first_row + row_count) of a frame, by its index in the manifest.
  // DATA_LOSS names the frame's file. Thread-safe.
  absl::StatusOr<FrameSamples> read(int frame, int first_row, int row_count) const;
  // The same, for open_interpolated().
  std::span<const std::uint16_t> rows(int frame, int first_row, int row_count) const;

 private:
  MappedArchive() = default;
  static absl::StatusOr<std::shared_ptr<MappedArchive>> map(const std::filesystem::path& directory);

  // The most recently read strip of a compressed file: bands of rows are often smaller.
  struct LastStrip {
    std::mutex mutex;
    int first_row = -1;
    std::shared_ptr<const std::uint16_t[]> samples;
  };
  // Rows within one strip.
  absl::StatusOr<FrameSamples> read_in_strip(int frame, int first_row, int row_count) const;
  absl::Status decompress(int frame, int first_row, int row_count, std::uint16_t* samples) const;

  // None: it is compressed, and not in memory.
  std::span<const std::uint16_t> samples_of(int frame) const;

  std::filesystem::path directory_;
  v1::CaptureManifest manifest_;
  std::vector<std::string_view> mappings_;
  std::vector<TiffRows> files_;               // by frame, in mappings_
  std::unique_ptr<LastStrip[]> last_strips_;  // by frame
  std::vector<Image16> in_memory_;            // by frame; empty where it is as in its file
};

}  // namespace glasswing
