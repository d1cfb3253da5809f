// Frames that lie in a directory, from wherever they came: an archive of ours, a foreign one, or photographs.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>

#include "client/photograph_list.h"
#include "core/frame/image.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct FrameSource {
  v1::CaptureManifest manifest;
  // The frame of this place in the manifest, whole and of the camera's size; otherwise DATA_LOSS or
  // INVALID_ARGUMENT names its file.
  std::function<absl::StatusOr<Image16>(int)> read;
};

// An archive (read_any_manifest).
absl::StatusOr<FrameSource> archive_source(const std::filesystem::path& directory);

// Photographs below `directory`, made linear; the first one tells the camera's size and bits.
absl::StatusOr<FrameSource> photograph_source(const std::filesystem::path& directory,
                                              const std::filesystem::path& list,
                                              const PhotographOptions& options);

}  // namespace glasswing
