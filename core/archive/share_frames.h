// Frames of the empty stage that one archive gives to another.
#pragma once

#include "core/archive/archive_store.h"
#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {

// ArchiveService.ShareFrames. The files are linked, so that they take no further room on the disk, and
// deleting one archive leaves the other whole. Errors are the service's.
absl::Status share_frames(ArchiveStore& store, const v1::ShareFramesRequest& request);

}  // namespace glasswing
