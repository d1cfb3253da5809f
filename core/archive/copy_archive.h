// A node's own copy of another node's archive.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <stop_token>

#include "core/archive/archive_store.h"
#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {

// Copies what is missing here, or damaged, frame by frame, each verified by its checksum, and seals the copy.
// `tell` hears how far it came after every few frames, at the end too; false: nobody listens any more, and
// the copying ends (CANCELLED), as when `stop` is asked for. Whatever was told of is durable. Errors are
// those of CopyArchive; DATA_LOSS names a frame that the other node cannot read.
absl::Status copy_archive(ArchiveStore& store, const v1::CopyArchiveRequest& request, std::stop_token stop,
                          const std::function<bool(const v1::CopyArchiveResponse&)>& tell);

}  // namespace glasswing
