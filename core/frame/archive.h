// A session archive: one directory, the same whether a camera spooled it, `export` wrote it or `import`
// reads it (docs/archive.md).
//
//   header.json     the manifest without frames, written when the archive starts
//   frames.jsonl    one line a frame, appended when its file is durable
//   manifest.json   header and frames, written when the archive is sealed
//   frames/*.tif    16-bit rgb, uncompressed TIFF, linear, pixels contiguous
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/mapped_file.h"
#include "core/frame/image.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

inline constexpr int kMaxSide_px = 16384;  // of cameras, monitors and pictures
inline constexpr int kMaxMonitors = 64;

// A frame's own file format: little-endian TIFF, one strip, starting at a fixed offset.
inline constexpr size_t kTiffPixelOffset = 256;
constexpr size_t tiff_size_bytes(int width_px, int height_px) {
  return kTiffPixelOffset + static_cast<size_t>(width_px) * static_cast<size_t>(height_px) * 6;
}
std::string encode_tiff(const Image16& image);
// DATA_LOSS unless `bytes` is what encode_tiff makes.
absl::StatusOr<Image16> decode_tiff(std::string_view bytes);
// DATA_LOSS unless `bytes` starts as encode_tiff starts a picture of this size.
absl::Status check_tiff_header(std::string_view bytes, int width_px, int height_px);

// Whether a manifest, wherever it came from, can be true at all: sides of 1 to kMaxSide_px, 1 to
// kMaxMonitors monitors with names of their own, frame files below the archive and each listed once, numbers
// that are finite. INVALID_ARGUMENT names the thing, its value and what would be accepted.
absl::Status check_manifest(const v1::CaptureManifest& manifest);
// The same of its parts. A header has no frames yet, and may lack monitors.
absl::Status check_manifest_header(const v1::CaptureManifest& manifest);
absl::Status check_frame(const v1::Frame& frame);

// Thread-safe.
class Archive {
 public:
  // Starts an archive; FAILED_PRECONDITION if `directory` holds one of another session, INVALID_ARGUMENT if
  // the header cannot be true (check_manifest_header).
  static absl::StatusOr<std::unique_ptr<Archive>> create(const std::filesystem::path& directory,
                                                         const v1::CaptureManifest& header);
  // Opens one, sealed or not; a torn last line of frames.jsonl (a power cut) is dropped.
  // NOT_FOUND, or DATA_LOSS naming the file that cannot be read or says what cannot be.
  static absl::StatusOr<std::unique_ptr<Archive>> open(const std::filesystem::path& directory);

  // Header and frames so far.
  v1::CaptureManifest manifest() const;

  // A frame with its picture still to be stored.
  struct NewFrame {
    v1::Frame record;  // file, checksum and size are filled in unless `file` is given
    Image16 image;
  };
  // Stores a batch; durable when it returns. A frame whose step (or, without steps, file) is already there is
  // left as it is. Returns the records now in the archive, in the batch's order. RESOURCE_EXHAUSTED: disk
  // full; INVALID_ARGUMENT: a record that cannot be true (check_frame), or a picture of another size;
  // ALREADY_EXISTS: another step's frame has that file.
  absl::StatusOr<std::vector<v1::Frame>> add(const std::vector<NewFrame>& frames);

  // A frame's file as another archive of the session holds it.
  struct CopiedFrame {
    v1::Frame record;
    std::string bytes;
  };
  // Stores a batch, byte for byte; durable when it returns. A frame that is here already is written anew, so
  // that a damaged one is put right. INVALID_ARGUMENT: bytes that are not what the record announces;
  // ALREADY_EXISTS: another frame has that name here.
  absl::Status add_copies(const std::vector<CopiedFrame>& frames);

  // Writes manifest.json.
  absl::Status seal();

  // A frame's file, verified: the whole file's checksum the first time that a frame is read, and again when
  // the file has changed since. DATA_LOSS names a file that is missing, short, altered or no picture of the
  // camera's size. Some thousand mappings are kept for the next time, until unmap().
  absl::StatusOr<std::shared_ptr<const MappedFile>> map(const std::string& file);
  void unmap();
  // The file itself, verified.
  absl::StatusOr<std::string> read_frame_bytes(const std::string& file);
  // INVALID_ARGUMENT unless every frame has these rows.
  absl::Status check_rows(int first_row, int row_count) const;
  size_t row_bytes() const { return static_cast<size_t>(width_px_) * 6; }

  const std::filesystem::path& directory() const { return directory_; }

 private:
  Archive(std::filesystem::path directory, v1::CaptureManifest manifest);
  absl::StatusOr<v1::Frame> find(const std::string& file) const;
  absl::Status verify(const MappedFile& mapped, const v1::Frame& frame) const;
  // With mutex_ held: durable in the journal, then known.
  absl::Status enter(const std::vector<v1::Frame>& fresh);

  const std::filesystem::path directory_;
  const int width_px_, height_px_;  // of every frame
  mutable std::mutex mutex_;
  v1::CaptureManifest manifest_;                                     // guarded by mutex_
  std::map<std::string, int> index_of_file_;                         // guarded by mutex_
  std::map<std::string, FileIdentity> verified_;                     // guarded by mutex_
  std::map<std::string, std::shared_ptr<const MappedFile>> mapped_;  // guarded by mutex_
};

}  // namespace glasswing
