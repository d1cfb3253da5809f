// Writes a session's archive to a directory.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

// With progress. Returns the manifest. ALREADY_EXISTS: the directory is neither new nor empty.
// FAILED_PRECONDITION: the session is being captured. DATA_LOSS: a frame arrived damaged.
absl::StatusOr<v1::CaptureManifest> export_archive(const v1::Session& session, const std::string& directory);

}  // namespace glasswing
