// Frames to import: from one of our archives or a foreign one, from photographs, or from a video.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/exchange/photograph_list.h"
#include "client/layouts/stack_samples.h"
#include "core/image/image.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Takes a file's next bytes.
using TakeBytes = std::function<absl::Status(std::string_view)>;

struct FrameSource {
  v1::CaptureManifest manifest;
  // Reads the frame of this index in the manifest. DATA_LOSS: it is damaged; INVALID_ARGUMENT: it does not
  // have the camera's size. Both name its file.
  std::function<absl::StatusOr<Image16>(int)> read;
  // Set if every frame's file has the format and name of our own archives: passes the file on unchanged, in
  // pieces. DATA_LOSS, after the last piece: its checksum is not the manifest's.
  std::function<absl::Status(int, const TakeBytes&)> pass_on = nullptr;
  // For all frames, once each has been read; null: nothing to check.
  std::function<absl::Status()> check = nullptr;
  bool was_read = false;                   // every frame was read and checked when the source was made
  std::vector<std::string> warnings = {};  // human-readable
};

// A whole archive (read_any_manifest).
absl::StatusOr<FrameSource> archive_source(const std::filesystem::path& directory);
// One of an archive's several sequences (core/import/sequences).
absl::StatusOr<FrameSource> sequence_source(const std::filesystem::path& directory,
                                            const std::string& sequence);

// The photographs of a list or a layout, in `directory`, linearised; the first one gives the camera's size
// and bits. An undeclared response is estimated, with a warning. INVALID_ARGUMENT: the photographs do not
// determine it. `samples`: lines of the photographs, if they were already read.
absl::StatusOr<FrameSource> photograph_source(const std::filesystem::path& directory, PhotographList list,
                                              std::optional<StackSamples> samples = std::nullopt);

// The warning about gaps in numbered pictures.
std::string missing_text(const std::filesystem::path& directory, std::int64_t count);

// A video of the ramp, linearised: a video file, or a directory of numbered pictures.
struct VideoOptions {
  PhotographOptions photographs;  // one monitor; sRGB if no response is given
  int empty_frames = 0;           // how many frames at the start show the empty stage
  std::string empty_directory;    // or a directory of pictures of the empty stage
};
// INVALID_ARGUMENT: an option is missing or out of range, or a frame's size or bits differ from the first's;
// it names the file. A video file that cannot be decoded to its end gives a warning.
absl::StatusOr<FrameSource> video_source(const std::filesystem::path& path, const VideoOptions& options);

}  // namespace glasswing
