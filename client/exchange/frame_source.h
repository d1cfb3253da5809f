// Frames from wherever they came: an archive of ours, a foreign one, photographs, or a video.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "client/exchange/photograph_list.h"
#include "core/frame/image.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct FrameSource {
  v1::CaptureManifest manifest;
  // The frame of this place in the manifest, whole and of the camera's size; otherwise DATA_LOSS or
  // INVALID_ARGUMENT names its file.
  std::function<absl::StatusOr<Image16>(int)> read;
  bool was_read = false;                   // every frame, when the source was made
  std::vector<std::string> warnings = {};  // for people
};

// An archive (read_any_manifest).
absl::StatusOr<FrameSource> archive_source(const std::filesystem::path& directory);
// One sequence of an archive with several (core/import/sequences).
absl::StatusOr<FrameSource> sequence_source(const std::filesystem::path& directory,
                                            const std::string& sequence);

// Photographs below `directory`, made linear; the first one tells the camera's size and bits.
absl::StatusOr<FrameSource> photograph_source(const std::filesystem::path& directory,
                                              const std::filesystem::path& list,
                                              const PhotographOptions& options);

// What to say of numbered pictures of which some are missing.
std::string missing_text(const std::filesystem::path& directory, std::int64_t count);

// A video of the ramp, made linear: a video file, or a directory of numbered pictures.
struct VideoOptions {
  PhotographOptions photographs;  // one monitor; sRGB if no response is given
  int empty_frames = 0;           // the first so many show the empty stage
  std::string empty_directory;    // or all pictures in here do
};
// INVALID_ARGUMENT: an option that is missing or out of range, or a frame that is not like the first, by its
// file. A video file is decoded as far as it can be; if that is not to its end, a warning says so.
absl::StatusOr<FrameSource> video_source(const std::filesystem::path& path, const VideoOptions& options);

}  // namespace glasswing
