// A capture's calls to its archive on the camera node. Each returns when the node has answered
// (NodeLink::call), or with CANCELLED when it is stopped.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "server/rig/rig_link.h"

namespace glasswing {

class CaptureArchive {
 public:
  // `links` is borrowed.
  CaptureArchive(const RigLinks& links, std::string session);

  // Creates the archive if it does not exist, and returns its manifest. The header of an existing one is
  // kept.
  absl::StatusOr<v1::CaptureManifest> open(const v1::CaptureManifest& header, std::stop_token stop);
  // Takes the frames of the empty stage that another session's archive has. Errors are
  // ArchiveService.ShareFrames'.
  absl::Status share(const std::string& from_session, std::stop_token stop);
  // RESOURCE_EXHAUSTED: less free disk space than this many frames need.
  absl::Status check_room(std::int64_t frame_count, std::stop_token stop);
  // Returns when all frames that are proven are durable.
  absl::StatusOr<v1::KeepFramesResponse> keep(const std::vector<v1::Frame>& frames, std::stop_token stop);
  // The same for frames of patch-learning steps. Frames of the monitors in `accept_unseen` are stored even if
  // they do not show the id patch. `last_sequences`: LearnPatchesRequest's. UNIMPLEMENTED: the camera node is
  // an older build.
  absl::StatusOr<v1::LearnPatchesResponse> learn_patches(const std::vector<v1::Frame>& frames,
                                                         const std::vector<std::int64_t>& last_sequences,
                                                         const std::vector<std::string>& accept_unseen,
                                                         std::stop_token stop);
  // Drops the frames of these steps, and reopens a sealed archive.
  absl::Status drop(const google::protobuf::RepeatedPtrField<v1::StepRange>& steps, std::stop_token stop);
  // By how much frames differ from stored ones, in the order of `comparisons`; empty: the camera node is an
  // older build.
  absl::StatusOr<std::vector<v1::FrameChange>> compare(const std::vector<v1::FrameComparison>& comparisons,
                                                       std::stop_token stop);
  // Whether the camera's newest frames of patch-learning steps, all of one monitor, show its patch. Stores
  // nothing.
  absl::StatusOr<bool> sees_patch(const std::vector<v1::Frame>& frames, std::stop_token stop);
  // With the current plan of an adaptive session.
  absl::Status seal(const v1::Plan& plan, std::stop_token stop);

  // The camera node ran out of disk space in one of the calls above.
  bool no_room() const { return no_room_; }

 private:
  // NodeLink::call() for a call that stores something.
  absl::Status store(const std::string& what, std::stop_token stop,
                     const std::function<grpc::Status(grpc::ClientContext&)>& call);

  const RigLinks& links_;
  const std::string session_;
  const std::unique_ptr<v1::ArchiveService::Stub> stub_;
  bool no_room_ = false;
};

}  // namespace glasswing
