// Copies another node's archive to this node.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <stop_token>

#include "core/archive/archive_store.h"
#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {

// Copies missing and damaged frames, verifying each checksum, and seals the copy. Calls `tell` with the
// progress after every batch and at the end; reported frames are durable. If `tell` returns false, `is_gone`
// true, or `stop` is requested, the copy ends with CANCELLED. Errors are those of CopyArchive; DATA_LOSS
// names a frame that the other node cannot read.
absl::Status copy_archive(ArchiveStore& store, const v1::CopyArchiveRequest& request, std::stop_token stop,
                          const std::function<bool()>& is_gone,
                          const std::function<bool(const v1::CopyArchiveResponse&)>& tell);

}  // namespace glasswing
