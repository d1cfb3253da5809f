// A session archive: one directory, with the same layout whether a camera spools it, `export` writes it or
// `import` reads it (docs/archive.md).
//
//   header.json     the manifest without frames, written when the archive is created
//   frames.jsonl    one line per frame, appended once its file is durable
//   manifest.json   header and frames, written when the archive is sealed
//   frames/*.tif    16-bit TIFF, linear, of rgb or one channel (tiff.h)
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "core/file/mapped_file.h"
#include "core/image/image.h"
#include "core/image/mosaic.h"
#include "core/image/tiff.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

inline constexpr int kMaxMonitors = 64;

// Validates a manifest from any source: sides of 1 to kMaxSide_px, 1 to kMaxMonitors monitors with distinct
// names, frame files below the archive and each listed once, finite numbers. INVALID_ARGUMENT names the
// field, its value and what would be accepted.
absl::Status check_manifest(const v1::CaptureManifest& manifest);
// The same for its parts. A header has no frames yet, and may lack monitors.
absl::Status check_manifest_header(const v1::CaptureManifest& manifest);
absl::Status check_frame(const v1::Frame& frame);
// The size of a frame's file: as listed, or else that of a plain one. DATA_LOSS, which names the file as
// `file`: its listed size is larger.
absl::StatusOr<size_t> listed_bytes(const v1::Frame& frame, const FrameShape& shape, std::string_view file);
// Whether an archive stores new frames under this name: frames/NAME, spelled exactly like this (another
// spelling would be another frame in the same file), with NAME not starting with a dot.
bool is_stored_name(const std::string& file);
// Whether a frame has such a name and is a TIFF, as in archives written by Glasswing.
bool is_stored_frame(const v1::Frame& frame);

// Thread-safe.
class Archive {
 public:
  // Creates an archive, or opens the existing one. FAILED_PRECONDITION: `directory` holds another session's
  // archive; INVALID_ARGUMENT: check_manifest_header() refuses the header.
  static absl::StatusOr<std::unique_ptr<Archive>> create(const std::filesystem::path& directory,
                                                         const v1::CaptureManifest& header);
  // Opens an archive, sealed or not; drops a truncated last line of frames.jsonl (a power cut). NOT_FOUND, or
  // DATA_LOSS naming the file that is unreadable or invalid.
  static absl::StatusOr<std::unique_ptr<Archive>> open(const std::filesystem::path& directory);

  // Header and frames so far.
  v1::CaptureManifest manifest() const;
  // NOT_FOUND: no frame of this step is stored.
  absl::StatusOr<v1::Frame> frame_of_step(int step) const;

  // A frame whose picture is still to be stored.
  struct NewFrame {
    v1::Frame record;  // checksum and size are filled in, and `file` where it is empty
    Image16 image;
  };
  // Stores a batch; durable when it returns. A frame whose step (or file, if there are no steps) is already
  // stored is left unchanged. Returns the records now in the archive, in the batch's order.
  // RESOURCE_EXHAUSTED: the disk is full; INVALID_ARGUMENT: check_frame() or is_stored_name() refuses a
  // record, or a picture has the wrong size; ALREADY_EXISTS: a frame of another step has that file name;
  // FAILED_PRECONDITION: a new frame for a sealed archive.
  absl::StatusOr<std::vector<v1::Frame>> add(const std::vector<NewFrame>& frames,
                                             FrameForm form = FrameForm::kPlain);

  // False: a frame of this step (or file, if there are no steps) is already stored. Errors as in add(); also
  // ALREADY_EXISTS: the stored frame of that step or file has a different checksum or file.
  absl::StatusOr<bool> is_new(const v1::Frame& record) const;

  // A frame whose file, complete and durable, is stored under a temporary name below the archive.
  struct ArrivedFrame {
    v1::Frame record;  // with checksum and size
    std::filesystem::path file;
  };
  // Gives a batch's files their names and lists them in the batch's order; durable when it returns. Files of
  // already stored frames stay where they are. Errors as in is_new(); then nothing of the batch is stored.
  absl::Status add_arrived(const std::vector<ArrivedFrame>& frames);

  // A frame's file, copied from another archive of the session.
  struct CopiedFrame {
    v1::Frame record;
    std::string bytes;
  };
  // Stores a batch, byte for byte; durable when it returns. An existing frame is rewritten, which repairs a
  // damaged one. INVALID_ARGUMENT: bytes that do not match their record; ALREADY_EXISTS: a different frame
  // has that file name here.
  absl::Status add_copies(const std::vector<CopiedFrame>& frames);

  // Removes the frames of the steps for which `is_dropped`, and reopens a sealed archive; durable when it
  // returns.
  absl::Status drop(const std::function<bool(int step)>& is_dropped);

  // Writes manifest.json. With `plan`, which may differ from the header's only in its rounds:
  // INVALID_ARGUMENT otherwise.
  absl::Status seal(const v1::Plan* plan = nullptr);

  // A frame's file, verified: its checksum is computed on first use and whenever the file has changed since.
  // DATA_LOSS names a file that is missing, truncated, altered or not of the camera's size. Up to 4096
  // mappings are kept until unmap().
  absl::StatusOr<std::shared_ptr<const MappedFile>> map(const std::string& file);
  void unmap();
  // The bytes of a frame's file, verified. Errors as map().
  absl::StatusOr<std::string> read_frame_bytes(const std::string& file);
  // INVALID_ARGUMENT unless frames have these rows.
  absl::Status check_rows(int first_row, int row_count) const;
  size_t row_bytes() const { return 2 * shape_.row_samples(); }
  const FrameShape& shape() const { return shape_; }  // of every frame

  const std::filesystem::path& directory() const { return directory_; }

 private:
  Archive(std::filesystem::path directory, v1::CaptureManifest manifest);
  absl::StatusOr<v1::Frame> find(const std::string& file) const;
  absl::Status verify(const MappedFile& mapped, const v1::Frame& frame) const;
  absl::Status check_open() const;  // FAILED_PRECONDITION if it is sealed; requires mutex_
  // Requires mutex_. Null: no frame of the record's step (or file, if there are no steps) is stored.
  const v1::Frame* stored_as(const v1::Frame& record) const;
  absl::StatusOr<bool> is_new_locked(const v1::Frame& record) const;  // requires mutex_
  void note_place(int index);  // of a frame in manifest_; requires mutex_
  // Appends to the journal, then to manifest_. Requires mutex_.
  absl::Status enter(const std::vector<v1::Frame>& fresh);

  const std::filesystem::path directory_;
  const FrameShape shape_;  // of every frame
  mutable std::mutex mutex_;
  v1::CaptureManifest manifest_;                                     // guarded by mutex_
  bool sealed_;                                                      // guarded by mutex_
  std::map<std::string, int> index_of_file_;                         // guarded by mutex_
  std::map<int, int> index_of_step_;                                 // guarded by mutex_
  std::map<std::string, FileIdentity> verified_;                     // guarded by mutex_
  std::map<std::string, std::shared_ptr<const MappedFile>> mapped_;  // guarded by mutex_
};

}  // namespace glasswing
