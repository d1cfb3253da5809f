// Judges frames of the ring by their pixels and stores those that pass in the session's archive.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "camera-node/services/form_choice.h"
#include "camera-node/services/frame_ring.h"
#include "camera-node/services/patch_proof.h"
#include "core/archive/archive_store.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

// Each method is the RPC of CameraService with its name, which documents its errors. Thread-safe.
class FrameKeeper {
 public:
  FrameKeeper(ArchiveStore& store, const FrameRing& ring) : store_(store), ring_(ring) {}
  absl::StatusOr<v1::KeepFramesResponse> keep(const v1::KeepFramesRequest& request);
  absl::StatusOr<v1::LearnPatchesResponse> learn(const v1::LearnPatchesRequest& request);
  absl::StatusOr<v1::LookForPatchesResponse> look(const v1::LookForPatchesRequest& request) const;

 private:
  using Frames = google::protobuf::RepeatedPtrField<v1::Frame>;
  struct Held {
    v1::Frame record;
    CapturedFrame frame;
  };
  // The requested frames that are still in the ring.
  absl::StatusOr<std::vector<Held>> find(const Frames& wanted) const;
  // The same with their pictures.
  absl::StatusOr<std::vector<Archive::NewFrame>> find_pictures(const Frames& wanted) const;
  // Those of LearnPatchesRequest.last_sequences that are still in the ring, by the frame's sequence.
  std::map<std::int64_t, CapturedFrame> find_last(const v1::LearnPatchesRequest& request) const;
  // Adds a set whose patch is not seen to the response. Returns true if its frames are to be stored.
  bool accepts(const v1::LearnPatchesRequest& request, const PatchProof::LearningSet& set,
               v1::LearnPatchesResponse& response) const;
  // Some pixel of some frame in the ring differs, from the session's first learning frame on. Requires
  // mutex_.
  bool has_changed_from(const Image16& image) const;
  // Judges the frames, and stores those that pass. Requires mutex_.
  absl::Status judge_and_store(Archive& archive, std::vector<Archive::NewFrame> frames, nanoseconds waited,
                               v1::KeepFramesResponse& response);
  // Sets proof_ for `session`: relearned from its archive if another session's frames came in between.
  absl::Status use_proof_of(const std::string& session, Archive& archive);
  // Age of the oldest of them relative to the newest frame in the ring.
  nanoseconds wait_of(const Frames& wanted) const;
  // `waited`: FormChoice's.
  absl::StatusOr<std::vector<v1::Frame>> store(Archive& archive, const std::vector<Archive::NewFrame>& frames,
                                               nanoseconds waited);

  ArchiveStore& store_;
  const FrameRing& ring_;
  std::mutex mutex_;           // held while frames are judged and stored
  std::string proof_session_;  // guarded by mutex_
  PatchProof proof_;           // of proof_session_; guarded by mutex_
  // Sequence of proof_session_'s first frame of kind "patch"; guarded by mutex_.
  std::int64_t learning_since_ = 0;
  // Whether proof_session_ is a calibration's, whose frames are read at single pixels; guarded by mutex_.
  bool of_calibration_ = false;
  FormChoice form_;  // guarded by mutex_
};

}  // namespace glasswing
