#include "core/archive/archive_service.h"

#include <fmt/format.h>

#include "core/archive/archive_location.h"
#include "core/archive/archive_metrics.h"
#include "core/archive/copy_archive.h"
#include "core/archive/row_chunks.h"
#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr size_t kMaxFrameBytes = size_t{2} << 30;
constexpr size_t kNamesOfAMessage = 1000;

absl::Status put(ArchiveStore& store, grpc::ServerReader<v1::PutFrameRequest>& reader) {
  v1::PutFrameRequest first;
  if (!reader.Read(&first) || !first.has_frame()) {
    return absl::InvalidArgumentError("the first message must name the session and the frame");
  }
  GW_ASSIGN_OR_RETURN(const std::shared_ptr<Archive> archive, store.find(first.session()));
  std::string bytes = first.chunk();
  v1::PutFrameRequest more;
  while (reader.Read(&more)) {
    bytes += more.chunk();
    if (bytes.size() > kMaxFrameBytes) return absl::InvalidArgumentError("the frame is larger than 2 GiB");
  }
  const v1::Frame& frame = first.frame();
  if (!is_stored_name(frame.file())) {
    return absl::InvalidArgumentError(fmt::format("file is \"{}\"; it must be frames/NAME", frame.file()));
  }
  if (frame.checksum() != checksum_of(bytes)) {
    return absl::InvalidArgumentError(fmt::format("{} arrived with checksum {}; {} was announced",
                                                  frame.file(), checksum_of(bytes), frame.checksum()));
  }
  absl::StatusOr<Image16> image = decode_tiff(bytes);
  if (!image.ok())
    return absl::InvalidArgumentError(
        fmt::format("{}: {}", frame.file(), std::string(image.status().message())));
  const v1::CaptureManifest manifest = archive->manifest();
  for (const v1::Frame& known : manifest.frames()) {
    // Resuming an interrupted import with different frames must not mix the two sets.
    if (known.file() == frame.file() && known.checksum() != frame.checksum()) {
      return absl::AlreadyExistsError(
          fmt::format("session \"{}\" holds another {} already; import under another name",
                      manifest.session(), frame.file()));
    }
  }
  GW_RETURN_IF_ERROR(check_shape(frame.file(), shape_of(*image), shape_of(manifest.camera())));
  GW_RETURN_IF_ERROR(store.room().check(static_cast<std::int64_t>(bytes.size())));
  return archive->add({{.record = frame, .image = *std::move(image)}}).status();
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

grpc::Status ArchiveServiceImpl::CreateArchive(grpc::ServerContext*, const v1::CreateArchiveRequest* request,
                                               v1::CreateArchiveResponse*) {
  return to_grpc(store_.create(request->manifest()).status());
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
  const absl::StatusOr<std::string> bytes = (*archive)->read_frame_bytes(request->file());
  if (!bytes.ok()) return to_grpc(bytes.status());
  for (size_t at = 0; at < bytes->size(); at += kChunkBytes) {
    v1::ReadFileResponse response;
    response.set_chunk(bytes->substr(at, kChunkBytes));
    if (!writer->Write(response)) break;
  }
  return grpc::Status::OK;
}

grpc::Status ArchiveServiceImpl::PutFrame(grpc::ServerContext*,
                                          grpc::ServerReader<v1::PutFrameRequest>* reader,
                                          v1::PutFrameResponse*) {
  return to_grpc(put(store_, *reader));
}

grpc::Status ArchiveServiceImpl::SealArchive(grpc::ServerContext*, const v1::SealArchiveRequest* request,
                                             v1::SealArchiveResponse*) {
  const absl::StatusOr<std::shared_ptr<Archive>> archive = store_.find(request->session());
  if (!archive.ok()) return to_grpc(archive.status());
  return to_grpc((*archive)->seal());
}

grpc::Status ArchiveServiceImpl::LocateArchive(grpc::ServerContext*, const v1::LocateArchiveRequest* request,
                                               v1::LocateArchiveResponse* response) {
  return to_grpc(locate(store_, *request, *response));
}

grpc::Status ArchiveServiceImpl::CopyArchive(grpc::ServerContext* context,
                                             const v1::CopyArchiveRequest* request,
                                             grpc::ServerWriter<v1::CopyArchiveResponse>* writer) {
  return to_grpc(
      copy_archive(store_, *request, stopping_.get_token(), [&](const v1::CopyArchiveResponse& progress) {
        return !context->IsCancelled() && writer->Write(progress);
      }));
}

grpc::Status ArchiveServiceImpl::DeleteArchive(grpc::ServerContext*, const v1::DeleteArchiveRequest* request,
                                               v1::DeleteArchiveResponse* response) {
  const absl::StatusOr<std::int64_t> freed = store_.remove(request->session());
  if (!freed.ok()) return to_grpc(freed.status());
  response->set_freed_bytes(*freed);
  return grpc::Status::OK;
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

grpc::Status ArchiveServiceImpl::GetSpace(grpc::ServerContext*, const v1::GetSpaceRequest*,
                                          v1::GetSpaceResponse* response) {
  const absl::StatusOr<DiskRoom::Room> room = store_.room().room();
  if (!room.ok()) return to_grpc(room.status());
  response->set_free_bytes(room->free_bytes);
  response->set_total_bytes(room->total_bytes);
  return grpc::Status::OK;
}

}  // namespace glasswing
