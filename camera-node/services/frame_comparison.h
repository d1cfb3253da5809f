// Compares frames with stored frames of the same pictures (core/image/picture_change.h).
#pragma once

#include <absl/status/statusor.h>

#include <map>
#include <mutex>
#include <string>

#include "camera-node/services/frame_ring.h"
#include "core/archive/archive_store.h"
#include "core/image/picture_change.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

// Thread-safe. Both arguments are borrowed.
class FrameComparison {
 public:
  FrameComparison(ArchiveStore& store, const FrameRing& ring) : store_(store), ring_(ring) {}
  // CameraService.CompareFrames, which documents its errors.
  absl::StatusOr<v1::CompareFramesResponse> compare(const v1::CompareFramesRequest& request);

 private:
  // Of a step's frame. NOT_FOUND: it has no such frame.
  absl::StatusOr<Brightness> stored(Archive& archive, int step);
  absl::StatusOr<Brightness> brightness(Archive& archive, const v1::FrameComparison& comparison);

  ArchiveStore& store_;
  const FrameRing& ring_;
  std::mutex mutex_;
  std::map<std::string, Brightness> read_;  // stored frames by checksum; guarded by mutex_
};

}  // namespace glasswing
