#include "core/archive/archive_service.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/archive/archive_location.h"
#include "core/archive/archive_metrics.h"
#include "core/archive/arriving_frames.h"
#include "core/archive/copy_archive.h"
#include "core/archive/row_chunks.h"
#include "core/archive/share_frames.h"
#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/security/peer.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr size_t kNamesOfAMessage = 1000;
constexpr int kMaxRanges = 20000;

// Operators need no token, but one that they send must be right. Without TLS everybody is an operator.
absl::Status check_import(ArchiveStore& store, const grpc::AuthContext& caller,
                          const v1::PutFrameRequest& request) {
  const bool is_operator = !shows_certificate(caller) || (roles_of(caller) & only(Role::kOperator)) != 0;
  if (request.import_token().empty() && is_operator) return absl::OkStatus();
  if (store.is_import(request.session(), request.import_token())) return absl::OkStatus();
  return absl::PermissionDeniedError(fmt::format(
      "the import of session \"{}\" has ended, or another one has begun; begin it again", request.session()));
}

absl::Status put(ArchiveStore& store, const grpc::AuthContext& caller,
                 grpc::ServerReader<v1::PutFrameRequest>& reader) {
  v1::PutFrameRequest message;
  if (!reader.Read(&message) || !message.has_frame()) {
    return absl::InvalidArgumentError("the first message must name the session and the frame");
  }
  GW_RETURN_IF_ERROR(check_import(store, caller, message));
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store.find(message.session()));
  ArrivingFrames frames(archive, store.room());
  do {
    if (message.has_frame()) GW_RETURN_IF_ERROR(frames.begin(message.frame()));
    GW_RETURN_IF_ERROR(frames.add(message.chunk()));
  } while (reader.Read(&message));
  return frames.finish();
}

// Answers one ReadRows call, then deletes itself.
class RowSender final : public grpc::ServerWriteReactor<grpc::ByteBuffer> {
 public:
  RowSender(ArchiveStore& store, grpc::ByteBuffer request) {
    v1::ReadRowsRequest parsed;
    const grpc::Status whole = grpc::SerializationTraits<v1::ReadRowsRequest>::Deserialize(&request, &parsed);
    if (!whole.ok()) {
      Finish(whole);
      return;
    }
    absl::StatusOr<std::unique_ptr<RowChunks>> chunks = RowChunks::create(store, std::move(parsed));
    if (!chunks.ok()) {
      Finish(to_grpc(chunks.status()));
      return;
    }
    chunks_ = *std::move(chunks);
    send_next();
  }

 private:
  void OnWriteDone(bool ok) override {
    if (ok) {
      send_next();
    } else {
      Finish(grpc::Status(grpc::StatusCode::CANCELLED, "the reader is gone"));
    }
  }
  void OnDone() override { delete this; }

  void send_next() {
    absl::StatusOr<std::optional<grpc::ByteBuffer>> message = chunks_->next();
    if (!message.ok() || !message->has_value()) {
      Finish(to_grpc(message.status()));
      return;
    }
    message_ = **std::move(message);
    archive_metrics().bytes_sent.Increment(static_cast<double>(message_.Length()));
    StartWrite(&message_);
  }

  std::unique_ptr<RowChunks> chunks_;
  grpc::ByteBuffer message_;  // being sent
};

absl::Status locate(ArchiveStore& store, const v1::LocateArchiveRequest& request,
                    v1::LocateArchiveResponse& response) {
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store.find(request.session()));
  for (const std::string& file : request.files()) GW_RETURN_IF_ERROR(archive->map(file).status());
  return describe_archive_location(archive->directory(), response);
}

}  // namespace

grpc::Status ArchiveServiceImpl::CreateArchive(grpc::ServerContext* context,
                                               const v1::CreateArchiveRequest* request,
                                               v1::CreateArchiveResponse* response) {
  const std::string& session = request->manifest().session();
  const auto create = [&]() -> absl::StatusOr<v1::CreateArchiveResponse> {
    GW_RETURN_IF_ERROR(store_.create(request->manifest()).status());
    return v1::CreateArchiveResponse();
  };
  const absl::StatusOr<v1::CreateArchiveResponse> created = creations_.run(*context, session, create);
  if (created.ok() && !request->import_token().empty()) store_.begin_import(session, request->import_token());
  return answer(created, *response);
}

grpc::Status ArchiveServiceImpl::ShareFrames(grpc::ServerContext* context,
                                             const v1::ShareFramesRequest* request,
                                             v1::ShareFramesResponse* response) {
  const auto share = [&]() -> absl::StatusOr<v1::ShareFramesResponse> {
    GW_RETURN_IF_ERROR(share_frames(store_, *request));
    return v1::ShareFramesResponse();
  };
  return answer(shares_.run(*context, request->session(), share), *response);
}

grpc::Status ArchiveServiceImpl::GetManifest(grpc::ServerContext*, const v1::GetManifestRequest* request,
                                             v1::GetManifestResponse* response) {
  const absl::StatusOr<std::shared_ptr<Archive>> archive = store_.find(request->session());
  if (!archive.ok()) return to_grpc(archive.status());
  *response->mutable_manifest() = (*archive)->manifest();
  return grpc::Status::OK;
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* ArchiveServiceImpl::ReadRows(grpc::CallbackServerContext*,
                                                                         const grpc::ByteBuffer* request) {
  return new RowSender(store_, *request);
}

grpc::Status ArchiveServiceImpl::ReadFile(grpc::ServerContext*, const v1::ReadFileRequest* request,
                                          grpc::ServerWriter<v1::ReadFileResponse>* writer) {
  const absl::StatusOr<std::shared_ptr<Archive>> archive = store_.find(request->session());
  if (!archive.ok()) return to_grpc(archive.status());
  const absl::StatusOr<std::shared_ptr<const MappedFile>> mapped = (*archive)->map(request->file());
  if (!mapped.ok()) return to_grpc(mapped.status());
  const std::string_view bytes = (*mapped)->bytes();
  if (request->offset_bytes() < 0 || request->offset_bytes() > static_cast<std::int64_t>(bytes.size())) {
    return to_grpc(absl::OutOfRangeError(
        fmt::format("offset_bytes is {}; it must be 0 to {}", request->offset_bytes(), bytes.size())));
  }
  v1::ReadFileResponse response;
  for (size_t at = request->offset_bytes(); at < bytes.size(); at += kChunkBytes) {
    response.set_chunk(bytes.data() + at, std::min(kChunkBytes, bytes.size() - at));
    if (!writer->Write(response)) break;
  }
  if ((*mapped)->intact()) return grpc::Status::OK;
  return to_grpc(absl::DataLossError(
      fmt::format("{} is truncated", ((*archive)->directory() / request->file()).string())));
}

grpc::Status ArchiveServiceImpl::PutFrame(grpc::ServerContext* context,
                                          grpc::ServerReader<v1::PutFrameRequest>* reader,
                                          v1::PutFrameResponse*) {
  return to_grpc(put(store_, *context->auth_context(), *reader));
}

grpc::Status ArchiveServiceImpl::DropFrames(grpc::ServerContext*, const v1::DropFramesRequest* request,
                                            v1::DropFramesResponse*) {
  if (request->steps_size() > kMaxRanges) {
    return to_grpc(absl::InvalidArgumentError(fmt::format(
        "{} ranges of steps in one call; at most {} are allowed", request->steps_size(), kMaxRanges)));
  }
  for (const v1::StepRange& range : request->steps()) {
    if (range.last() < range.first())
      return to_grpc(absl::InvalidArgumentError(
          fmt::format("steps {} to {}: the last must not be before the first", range.first(), range.last())));
  }
  const absl::StatusOr<std::shared_ptr<Archive>> archive = store_.find(request->session());
  if (!archive.ok()) return to_grpc(archive.status());
  return to_grpc((*archive)->drop([request](int step) {
    return std::ranges::any_of(request->steps(), [step](const v1::StepRange& range) {
      return range.first() <= step && step <= range.last();
    });
  }));
}

grpc::Status ArchiveServiceImpl::SealArchive(grpc::ServerContext* context,
                                             const v1::SealArchiveRequest* request,
                                             v1::SealArchiveResponse* response) {
  const auto seal = [&]() -> absl::StatusOr<v1::SealArchiveResponse> {
    GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store_.find(request->session()));
    GW_RETURN_IF_ERROR(archive->seal(request->has_plan() ? &request->plan() : nullptr));
    store_.end_import(request->session());
    return v1::SealArchiveResponse();
  };
  return answer(seals_.run(*context, checksum_of(request->SerializeAsString()), seal), *response);
}

grpc::Status ArchiveServiceImpl::LocateArchive(grpc::ServerContext*, const v1::LocateArchiveRequest* request,
                                               v1::LocateArchiveResponse* response) {
  return to_grpc(locate(store_, *request, *response));
}

grpc::Status ArchiveServiceImpl::CopyArchive(grpc::ServerContext* context,
                                             const v1::CopyArchiveRequest* request,
                                             grpc::ServerWriter<v1::CopyArchiveResponse>* writer) {
  return to_grpc(copy_archive(
      store_, *request, stopping_.get_token(), [context] { return context->IsCancelled(); },
      [writer](const v1::CopyArchiveResponse& progress) { return writer->Write(progress); }));
}

grpc::Status ArchiveServiceImpl::DeleteArchive(grpc::ServerContext* context,
                                               const v1::DeleteArchiveRequest* request,
                                               v1::DeleteArchiveResponse* response) {
  const auto remove = [&]() -> absl::StatusOr<v1::DeleteArchiveResponse> {
    GW_ASSIGN_OR_RETURN(const std::int64_t freed, store_.remove(request->session()));
    v1::DeleteArchiveResponse deleted;
    deleted.set_freed_bytes(freed);
    return deleted;
  };
  return answer(deletions_.run(*context, request->session(), remove), *response);
}

grpc::Status ArchiveServiceImpl::ListArchives(grpc::ServerContext*, const v1::ListArchivesRequest*,
                                              grpc::ServerWriter<v1::ListArchivesResponse>* writer) {
  const std::vector<std::string> names = store_.sessions();
  for (size_t at = 0; at < names.size(); at += kNamesOfAMessage) {
    v1::ListArchivesResponse response;
    for (size_t i = at; i < std::min(at + kNamesOfAMessage, names.size()); ++i)
      response.add_sessions(names[i]);
    if (!writer->Write(response)) break;
  }
  return grpc::Status::OK;
}

grpc::Status ArchiveServiceImpl::GetSpace(grpc::ServerContext*, const v1::GetSpaceRequest* request,
                                          v1::GetSpaceResponse* response) {
  const absl::StatusOr<DiskRoom::Room> room = store_.room().room();
  if (!room.ok()) return to_grpc(room.status());
  response->set_free_bytes(room->free_bytes);
  response->set_total_bytes(room->total_bytes);
  if (request->measure_writing() && room->free_bytes > 0) {
    const absl::StatusOr<std::int64_t> speed = store_.speed().write_bytes_per_second();
    if (!speed.ok()) return to_grpc(speed.status());
    response->set_write_bytes_per_second(*speed);
  }
  return grpc::Status::OK;
}

}  // namespace glasswing
