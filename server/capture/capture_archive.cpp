#include "server/capture/capture_archive.h"

#include <fmt/format.h>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/frame/archive.h"

namespace glasswing {

CaptureArchive::CaptureArchive(const RigLinks& links, std::string session)
    : links_(links),
      session_(std::move(session)),
      stub_(v1::ArchiveService::NewStub(links.camera->channel())) {}

absl::Status CaptureArchive::store(const std::string& what, std::stop_token stop,
                                   const std::function<grpc::Status(grpc::ClientContext&)>& call) {
  const absl::Status stored = links_.camera->call(what, std::move(stop), call);
  no_room_ = no_room_ || absl::IsResourceExhausted(stored);
  return stored;
}

absl::StatusOr<v1::CaptureManifest> CaptureArchive::open(const v1::CaptureManifest& header,
                                                         std::stop_token stop) {
  v1::CreateArchiveRequest create;
  *create.mutable_manifest() = header;
  v1::CreateArchiveResponse created;
  GW_RETURN_IF_ERROR(store("create the archive", stop, [&](grpc::ClientContext& context) {
    return stub_->CreateArchive(&context, create, &created);
  }));
  v1::GetManifestRequest get;
  get.set_session(session_);
  v1::GetManifestResponse got;
  GW_RETURN_IF_ERROR(links_.camera->call("read the archive", stop, [&](grpc::ClientContext& context) {
    return stub_->GetManifest(&context, get, &got);
  }));
  return std::move(*got.mutable_manifest());
}

absl::Status CaptureArchive::share(const std::string& from_session, std::stop_token stop) {
  v1::ShareFramesRequest request;
  request.set_session(session_);
  request.set_from_session(from_session);
  v1::ShareFramesResponse shared;
  return store("share the empty stage's frames", std::move(stop),
               [&](grpc::ClientContext& context) { return stub_->ShareFrames(&context, request, &shared); });
}

absl::Status CaptureArchive::check_room(std::int64_t frame_count, std::stop_token stop) {
  const std::int64_t needed_bytes =
      frame_count * static_cast<std::int64_t>(tiff_size_bytes(shape_of(links_.camera_info.camera())));
  v1::GetSpaceResponse space;
  GW_RETURN_IF_ERROR(links_.camera->call("look at its disk", stop, [&](grpc::ClientContext& context) {
    return stub_->GetSpace(&context, {}, &space);
  }));
  if (needed_bytes <= space.free_bytes()) return absl::OkStatus();
  no_room_ = true;
  return absl::ResourceExhaustedError(fmt::format(
      "{:.1f} MB of disk space are missing at the {}: {} frames remain, {:.1f} MB, and {:.1f} MB are free "
      "for "
      "frames; delete sessions there",
      1e-6 * static_cast<double>(needed_bytes - space.free_bytes()), links_.camera->title(), frame_count,
      1e-6 * static_cast<double>(needed_bytes), 1e-6 * static_cast<double>(space.free_bytes())));
}

absl::StatusOr<v1::KeepFramesResponse> CaptureArchive::keep(const std::vector<v1::Frame>& frames,
                                                            std::stop_token stop) {
  v1::KeepFramesRequest request;
  request.set_session(session_);
  request.set_request_id(random_token());
  request.mutable_frames()->Assign(frames.begin(), frames.end());
  v1::KeepFramesResponse response;
  GW_RETURN_IF_ERROR(store("store frames", stop, [&](grpc::ClientContext& context) {
    return links_.camera_stub->KeepFrames(&context, request, &response);
  }));
  return response;
}

absl::StatusOr<v1::LearnPatchesResponse> CaptureArchive::learn_patches(
    const std::vector<v1::Frame>& frames, const std::vector<std::int64_t>& last_sequences,
    const std::vector<std::string>& accept_unseen, std::stop_token stop) {
  v1::LearnPatchesRequest request;
  request.set_session(session_);
  request.set_request_id(random_token());
  request.mutable_frames()->Assign(frames.begin(), frames.end());
  request.mutable_last_sequences()->Assign(last_sequences.begin(), last_sequences.end());
  request.mutable_accept_unseen_patches()->Assign(accept_unseen.begin(), accept_unseen.end());
  v1::LearnPatchesResponse response;
  const absl::Status learned = store("learn id patches", stop, [&](grpc::ClientContext& context) {
    return links_.camera_stub->LearnPatches(&context, request, &response);
  });
  if (absl::IsUnimplemented(learned)) {
    return absl::UnimplementedError(
        fmt::format("the {} cannot learn id patches (LearnPatches): install this server's version there",
                    links_.camera->title()));
  }
  GW_RETURN_IF_ERROR(learned);
  return response;
}

absl::Status CaptureArchive::drop(const google::protobuf::RepeatedPtrField<v1::StepRange>& steps,
                                  std::stop_token stop) {
  v1::DropFramesRequest request;
  request.set_session(session_);
  *request.mutable_steps() = steps;
  v1::DropFramesResponse response;
  return store("drop frames", std::move(stop),
               [&](grpc::ClientContext& context) { return stub_->DropFrames(&context, request, &response); });
}

absl::StatusOr<std::vector<v1::FrameChange>> CaptureArchive::compare(
    const std::vector<v1::FrameComparison>& comparisons, std::stop_token stop) {
  v1::CompareFramesRequest request;
  request.set_session(session_);
  request.mutable_comparisons()->Assign(comparisons.begin(), comparisons.end());
  v1::CompareFramesResponse response;
  const absl::Status compared =
      links_.camera->call("compare frames", std::move(stop), [&](grpc::ClientContext& context) {
        return links_.camera_stub->CompareFrames(&context, request, &response);
      });
  if (absl::IsUnimplemented(compared)) return std::vector<v1::FrameChange>();
  GW_RETURN_IF_ERROR(compared);
  return std::vector<v1::FrameChange>(response.changes().begin(), response.changes().end());
}

absl::StatusOr<bool> CaptureArchive::sees_patch(const std::vector<v1::Frame>& frames, std::stop_token stop) {
  v1::LookForPatchesRequest request;
  request.mutable_frames()->Assign(frames.begin(), frames.end());
  v1::LookForPatchesResponse response;
  GW_RETURN_IF_ERROR(
      links_.camera->call("look for id patches", std::move(stop), [&](grpc::ClientContext& context) {
        return links_.camera_stub->LookForPatches(&context, request, &response);
      }));
  return response.unseen_patches().empty();
}

absl::Status CaptureArchive::seal(const v1::Plan& plan, std::stop_token stop) {
  v1::SealArchiveRequest request;
  request.set_session(session_);
  if (plan.has_adapt()) *request.mutable_plan() = plan;
  v1::SealArchiveResponse response;
  return store("seal the archive", std::move(stop), [&](grpc::ClientContext& context) {
    return stub_->SealArchive(&context, request, &response);
  });
}

}  // namespace glasswing
