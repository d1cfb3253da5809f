#include <fmt/format.h>

#include <algorithm>

#include "client/commands.h"
#include "client/output.h"
#include "client/progress.h"
#include "client/rpc.h"
#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/frame/image_file.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Whole, of the announced checksum, and of the camera's size; otherwise DATA_LOSS or NOT_FOUND names the
// file.
absl::StatusOr<Image16> read_verified(const fs::path& directory, const v1::CaptureManifest& manifest,
                                      const v1::Frame& frame) {
  const fs::path path = directory / frame.file();
  if (!frame.checksum().empty()) {
    GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(path));
    if (checksum_of(bytes) != frame.checksum()) {
      return absl::DataLossError(fmt::format("{} is damaged: its checksum is {}, the manifest says {}",
                                             path.string(), checksum_of(bytes), frame.checksum()));
    }
  }
  return read_frame_file(path, PictureSize{.width_px = manifest.camera().width_px(),
                                           .height_px = manifest.camera().height_px()});
}

absl::Status verify(const fs::path& directory, const v1::CaptureManifest& manifest) {
  Progress progress("checking");
  for (int i = 0; i < manifest.frames_size(); ++i) {
    GW_RETURN_IF_ERROR(read_verified(directory, manifest, manifest.frames(i)).status());
    progress.update((i + 1.0) / manifest.frames_size(),
                    fmt::format("{} of {} frames", i + 1, manifest.frames_size()));
  }
  return absl::OkStatus();
}

absl::Status put_frame(const Peer<v1::ArchiveService>& archive, const std::string& session,
                       const v1::Frame& frame, const std::string& tiff) {
  grpc::ClientContext context;
  set_deadline(context, kLongCallTimeout);
  v1::PutFrameResponse stored;
  const auto writer = archive.stub->PutFrame(&context, &stored);
  v1::PutFrameRequest request;
  request.set_session(session);
  *request.mutable_frame() = frame;
  bool open = writer->Write(request);
  for (size_t at = 0; open && at < tiff.size(); at += kChunkBytes) {
    v1::PutFrameRequest part;
    part.set_chunk(tiff.substr(at, kChunkBytes));
    open = writer->Write(part);  // once false, Finish() says why
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  return status.ok() ? absl::OkStatus() : status_from(status, archive.title);
}

// Frames are kept as TIFF; those of foreign archives get the name that their place gives them.
bool has_own_names(const v1::CaptureManifest& manifest) {
  return std::all_of(manifest.frames().begin(), manifest.frames().end(), [](const v1::Frame& frame) {
    const fs::path file(frame.file());
    return file.parent_path() == "frames" && file.extension() == ".tif";
  });
}

absl::Status send_frames(const fs::path& directory, const v1::CaptureManifest& manifest,
                         const std::string& session, const std::string& address) {
  const Peer<v1::ArchiveService> archive("camera node at " + address, address);
  const bool own_names = has_own_names(manifest);
  Progress progress("importing");
  for (int i = 0; i < manifest.frames_size(); ++i) {
    v1::Frame frame = manifest.frames(i);
    GW_ASSIGN_OR_RETURN(const Image16 image, read_verified(directory, manifest, frame));
    const std::string tiff = encode_tiff(image);
    if (!own_names) frame.set_file(fmt::format("frames/{:06d}.tif", i));
    frame.set_checksum(checksum_of(tiff));
    frame.set_size_bytes(static_cast<std::int64_t>(tiff.size()));
    GW_RETURN_IF_ERROR(put_frame(archive, session, frame, tiff));
    progress.update((i + 1.0) / manifest.frames_size(),
                    fmt::format("{} of {} frames", i + 1, manifest.frames_size()));
  }
  return absl::OkStatus();
}

// The last part of the path, whether or not it ends in a slash.
std::string name_of_directory(const fs::path& directory) {
  const fs::path normal = fs::weakly_canonical(directory);
  return (normal.has_filename() ? normal : normal.parent_path()).filename().string();
}

absl::Status import(const Client& client, const std::string& directory, std::string name) {
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, read_any_manifest(directory));
  if (name.empty()) name = name_of_directory(directory);
  GW_RETURN_IF_ERROR(check_name("session", name));
  GW_RETURN_IF_ERROR(verify(directory, manifest));
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::BeginImportRequest begin;
  begin.set_name(name);
  *begin.mutable_manifest() = manifest;
  begin.mutable_manifest()->clear_frames();
  begin.mutable_manifest()->set_session(name);
  GW_ASSIGN_OR_RETURN(const v1::BeginImportResponse begun,
                      call(server, &v1::SessionService::Stub::BeginImport, begin, kLongCallTimeout));
  GW_RETURN_IF_ERROR(send_frames(directory, manifest, name, begun.session().archive_address()));
  v1::FinishImportRequest finish;
  finish.set_name(name);
  GW_ASSIGN_OR_RETURN(const v1::FinishImportResponse finished,
                      call(server, &v1::SessionService::Stub::FinishImport, finish, kLongCallTimeout));
  print_session(finished.session(), client.json);
  return absl::OkStatus();
}

}  // namespace

void add_import_command(CLI::App& app, Client& client) {
  struct Arguments {
    std::string directory;
    std::string session;
  };
  CLI::App& command = *app.add_subcommand("import", "Make a session of frames that lie in a directory.");
  command.footer(
      "Every frame is checked before any is sent. An import that broke off may be started again.\n\n"
      "Example:\n  glasswing import archives/vase --session vase");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("directory", arguments->directory, "a session archive: manifest.json and its frames")
      ->required();
  command.add_option("--session", arguments->session, "its name; the directory's if left out");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] { return import(client, arguments->directory, arguments->session); };
  });
}

}  // namespace glasswing
