#include "core/archive/remote_archive.h"

#include <cstring>

#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {

RemoteArchive::RemoteArchive(const std::string& address, std::string session, std::stop_token stop)
    : peer_("camera node at " + address),
      session_(std::move(session)),
      stub_(v1::ArchiveService::NewStub(dial(address))),
      stop_(std::move(stop)) {}

absl::StatusOr<v1::CaptureManifest> RemoteArchive::manifest() const {
  v1::GetManifestRequest get;
  get.set_session(session_);
  v1::GetManifestResponse got;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(30));
  GW_RETURN_IF_ERROR(from_grpc(stub_->GetManifest(&context, get, &got), peer_));
  return std::move(*got.mutable_manifest());
}

absl::StatusOr<std::vector<std::uint16_t>> RemoteArchive::rows(const v1::CaptureManifest& manifest,
                                                               const std::vector<int>& frames, int first_row,
                                                               int row_count) const {
  const size_t frame_bytes =
      static_cast<size_t>(row_count) * static_cast<size_t>(manifest.camera().width_px()) * 6;
  v1::ReadRowsRequest read;
  read.set_session(session_);
  read.set_first_row(first_row);
  read.set_row_count(row_count);
  for (const int frame : frames) read.add_files(manifest.frames(frame).file());
  std::vector<std::uint16_t> samples(frames.size() * frame_bytes / 2);
  grpc::ClientContext context;
  set_deadline(context, std::chrono::minutes(5));
  const std::stop_callback cancel(stop_, [&] { context.TryCancel(); });
  const auto reader = stub_->ReadRows(&context, read);
  v1::ReadRowsResponse response;
  size_t received = 0;
  while (reader->Read(&response)) {
    const auto offset = static_cast<size_t>(response.offset_bytes());
    if (offset + response.chunk().size() > samples.size() * 2) {
      context.TryCancel();
      return absl::DataLossError(peer_ + " sent rows that were not asked for");
    }
    auto* bytes = reinterpret_cast<char*>(samples.data());
    std::memcpy(bytes + offset, response.chunk().data(), response.chunk().size());
    received += response.chunk().size();
  }
  GW_RETURN_IF_ERROR(from_grpc(reader->Finish(), peer_));
  if (received != frames.size() * frame_bytes)
    return absl::UnavailableError(peer_ + " sent fewer rows than asked for");
  return samples;
}

}  // namespace glasswing
