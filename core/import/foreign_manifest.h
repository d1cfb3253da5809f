// Manifests that users bring: ours as they are, others translated entry by entry.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Any archive a user may bring: ours, or a directory with a manifest.json of the rendered data sets
// ({"monitor": {name: {width, height}}, "image": {...}, "frames": [{file, object, stimulus}]}).
// Only the manifest is read; frame files stay where they are, in whatever format. DATA_LOSS or
// INVALID_ARGUMENT name the file and the entry at fault.
absl::StatusOr<v1::CaptureManifest> read_any_manifest(const std::filesystem::path& directory);

// Monitors, camera and scene of such a data set whose frames lie in several sequences (sequences.h); frames
// that the manifest lists are left out. INVALID_ARGUMENT or DATA_LOSS name the file and what is wrong.
absl::StatusOr<v1::CaptureManifest> read_sequences_header(const std::filesystem::path& directory);

}  // namespace glasswing
