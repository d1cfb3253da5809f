#include "server/capture/capture_archive.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kStoreCall(1);  // of a batch of frames

}  // namespace

CaptureArchive::CaptureArchive(const RigLinks& links, std::string session)
    : links_(links),
      session_(std::move(session)),
      stub_(v1::ArchiveService::NewStub(links.camera->channel())) {}

absl::Status CaptureArchive::stored(const grpc::Status& status) {
  no_room_ = no_room_ || status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED;
  return from_grpc(status, links_.camera->title());
}

absl::StatusOr<v1::CaptureManifest> CaptureArchive::open(const v1::CaptureManifest& header) {
  v1::CreateArchiveRequest create;
  *create.mutable_manifest() = header;
  v1::CreateArchiveResponse created;
  grpc::ClientContext create_context;
  set_deadline(create_context, kNodeCall);
  GW_RETURN_IF_ERROR(stored(stub_->CreateArchive(&create_context, create, &created)));
  v1::GetManifestRequest get;
  get.set_session(session_);
  v1::GetManifestResponse got;
  grpc::ClientContext get_context;
  set_deadline(get_context, kNodeCall);
  GW_RETURN_IF_ERROR(from_grpc(stub_->GetManifest(&get_context, get, &got), links_.camera->title()));
  return std::move(*got.mutable_manifest());
}

absl::Status CaptureArchive::check_room(std::int64_t frame_count) {
  const std::int64_t needed_bytes =
      frame_count * static_cast<std::int64_t>(tiff_size_bytes(shape_of(links_.camera_info.camera())));
  v1::GetSpaceResponse space;
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  GW_RETURN_IF_ERROR(from_grpc(stub_->GetSpace(&context, {}, &space), links_.camera->title()));
  if (needed_bytes <= space.free_bytes()) return absl::OkStatus();
  no_room_ = true;
  return absl::ResourceExhaustedError(fmt::format(
      "{:.1f} MB of disk are missing at the {}: {} frames are still to come, {:.1f} MB, and {:.1f} "
      "MB are free for frames; delete sessions there",
      1e-6 * static_cast<double>(needed_bytes - space.free_bytes()), links_.camera->title(), frame_count,
      1e-6 * static_cast<double>(needed_bytes), 1e-6 * static_cast<double>(space.free_bytes())));
}

absl::StatusOr<v1::KeepFramesResponse> CaptureArchive::keep(const std::vector<v1::Frame>& frames) {
  v1::KeepFramesRequest request;
  request.set_session(session_);
  request.mutable_frames()->Assign(frames.begin(), frames.end());
  v1::KeepFramesResponse response;
  grpc::ClientContext context;
  set_deadline(context, kStoreCall);
  GW_RETURN_IF_ERROR(stored(links_.camera_stub->KeepFrames(&context, request, &response)));
  return response;
}

absl::StatusOr<v1::LearnPatchesResponse> CaptureArchive::learn_patches(
    const std::vector<v1::Frame>& frames, const std::vector<std::string>& accept_unseen) {
  v1::LearnPatchesRequest request;
  request.set_session(session_);
  request.mutable_frames()->Assign(frames.begin(), frames.end());
  request.mutable_accept_unseen_patches()->Assign(accept_unseen.begin(), accept_unseen.end());
  v1::LearnPatchesResponse response;
  grpc::ClientContext context;
  set_deadline(context, kStoreCall);
  const grpc::Status status = links_.camera_stub->LearnPatches(&context, request, &response);
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
    return absl::UnimplementedError(
        fmt::format("the {} cannot learn id patches (LearnPatches): install this server's version there",
                    links_.camera->title()));
  }
  GW_RETURN_IF_ERROR(stored(status));
  return response;
}

absl::Status CaptureArchive::seal(const v1::Plan& plan) {
  v1::SealArchiveRequest request;
  request.set_session(session_);
  if (plan.has_adapt()) *request.mutable_plan() = plan;
  v1::SealArchiveResponse response;
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  return stored(stub_->SealArchive(&context, request, &response));
}

}  // namespace glasswing
