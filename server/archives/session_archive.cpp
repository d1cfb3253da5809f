#include "server/archives/session_archive.h"

#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {

SessionArchive::SessionArchive(const v1::Session& session)
    : session_(session.name()),
      peer_("camera node at " + session.archive_address()),
      stub_(v1::ArchiveService::NewStub(dial(session.archive_address(), kArchiveKeepers))) {}

SessionArchive::SessionArchive(std::string session, const std::string& node, const std::string& address)
    : session_(std::move(session)),
      peer_(fmt::format("node \"{}\" at {}", node, address)),
      stub_(v1::ArchiveService::NewStub(dial(address, kArchiveKeepers))) {}

absl::Status SessionArchive::check_answers() {
  v1::GetSpaceResponse response;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(10));
  return from_grpc(stub_->GetSpace(&context, {}, &response), peer_);
}

absl::Status SessionArchive::seal() {
  v1::SealArchiveRequest request;
  request.set_session(session_);
  v1::SealArchiveResponse response;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(30));
  return from_grpc(stub_->SealArchive(&context, request, &response), peer_);
}

absl::StatusOr<v1::CaptureManifest> SessionArchive::manifest() {
  v1::GetManifestRequest request;
  request.set_session(session_);
  v1::GetManifestResponse response;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(30));
  GW_RETURN_IF_ERROR(from_grpc(stub_->GetManifest(&context, request, &response), peer_));
  return std::move(*response.mutable_manifest());
}

absl::StatusOr<std::int64_t> SessionArchive::remove() {
  v1::DeleteArchiveRequest request;
  request.set_session(session_);
  v1::DeleteArchiveResponse response;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::minutes(5));
  GW_RETURN_IF_ERROR(from_grpc(stub_->DeleteArchive(&context, request, &response), peer_));
  return response.freed_bytes();
}

}  // namespace glasswing
