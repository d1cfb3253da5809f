// Manifests of archives that users import: our own format, or that of the rendered data sets, translated.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Reads the manifest.json of our own archives or of the rendered data sets ({"monitor": {name: {width,
// height}}, "image": {...}, "frames": [{file, object, stimulus}]}). Frame files are not opened and may have
// any format. DATA_LOSS or INVALID_ARGUMENT name the file and the entry at fault.
absl::StatusOr<v1::CaptureManifest> read_any_manifest(const std::filesystem::path& directory);

// Monitors, camera and scene of such a data set with frames in several sequences (sequences.h); frames that
// the manifest lists are left out. INVALID_ARGUMENT or DATA_LOSS name the file and what is wrong.
absl::StatusOr<v1::CaptureManifest> read_sequences_header(const std::filesystem::path& directory);

}  // namespace glasswing
