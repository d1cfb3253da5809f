#include "core/archive/archive_service.h"

#include <fmt/format.h>

#include "core/base/file.h"
#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr size_t kMaxFrameBytes = size_t{2} << 30;

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
  const std::filesystem::path file(frame.file());
  if (file.is_absolute() || file.parent_path() != "frames" || file.filename() == "..") {
    return absl::InvalidArgumentError(fmt::format("file is \"{}\"; it must be frames/NAME", frame.file()));
  }
  if (frame.checksum() != checksum_of(bytes)) {
    return absl::InvalidArgumentError(fmt::format("{} arrived with checksum {}, announced was {}",
                                                  frame.file(), checksum_of(bytes), frame.checksum()));
  }
  absl::StatusOr<Image16> image = decode_tiff(bytes);
  if (!image.ok())
    return absl::InvalidArgumentError(
        fmt::format("{}: {}", frame.file(), std::string(image.status().message())));
  const v1::CaptureManifest manifest = archive->manifest();
  for (const v1::Frame& known : manifest.frames()) {
    // A broken import taken up again with other frames must not mix the two.
    if (known.file() == frame.file() && known.checksum() != frame.checksum()) {
      return absl::AlreadyExistsError(
          fmt::format("session \"{}\" holds another {} already; import under another name",
                      manifest.session(), frame.file()));
    }
  }
  const v1::Camera& camera = manifest.camera();
  if (image->width_px != camera.width_px() || image->height_px != camera.height_px()) {
    return absl::InvalidArgumentError(fmt::format("{} is {}x{}; the manifest says {}x{}", frame.file(),
                                                  image->width_px, image->height_px, camera.width_px(),
                                                  camera.height_px()));
  }
  return archive->add({{.record = frame, .image = *std::move(image)}}).status();
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

grpc::Status ArchiveServiceImpl::ReadRows(grpc::ServerContext* context, const v1::ReadRowsRequest* request,
                                          grpc::ServerWriter<v1::ReadRowsResponse>* writer) {
  const absl::StatusOr<std::shared_ptr<Archive>> archive = store_.find(request->session());
  if (!archive.ok()) return to_grpc(archive.status());
  std::int64_t start = 0;
  for (int i = 0; i < request->files_size() && !context->IsCancelled(); ++i) {
    const absl::StatusOr<std::string> rows =
        (*archive)->read_rows(request->files(i), request->first_row(), request->row_count());
    if (!rows.ok()) return to_grpc(rows.status());
    for (size_t at = 0; at < rows->size(); at += kChunkBytes) {
      v1::ReadRowsResponse response;
      response.set_offset_bytes(start + static_cast<std::int64_t>(at));
      response.set_chunk(rows->substr(at, kChunkBytes));
      if (!writer->Write(response)) return grpc::Status::OK;
    }
    start += static_cast<std::int64_t>(rows->size());
  }
  return grpc::Status::OK;
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

grpc::Status ArchiveServiceImpl::DeleteArchive(grpc::ServerContext*, const v1::DeleteArchiveRequest* request,
                                               v1::DeleteArchiveResponse* response) {
  const absl::StatusOr<std::int64_t> freed = store_.remove(request->session());
  if (!freed.ok()) return to_grpc(freed.status());
  response->set_freed_bytes(*freed);
  return grpc::Status::OK;
}

grpc::Status ArchiveServiceImpl::GetSpace(grpc::ServerContext*, const v1::GetSpaceRequest*,
                                          v1::GetSpaceResponse* response) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(store_.directory(), error);
  if (error)
    return to_grpc(
        absl::ErrnoToStatus(error.value(), "cannot tell the space below " + store_.directory().string()));
  response->set_free_bytes(static_cast<std::int64_t>(space.available));
  response->set_total_bytes(static_cast<std::int64_t>(space.capacity));
  return grpc::Status::OK;
}

}  // namespace glasswing
