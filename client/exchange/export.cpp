#include "client/exchange/export.h"

#include <fmt/format.h>

#include <iostream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/exchange/commands.h"
#include "client/exchange/partial_directory.h"
#include "core/archive/disk_room.h"
#include "core/base/checksum.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Reads a frame's file from the node into `path`, which is left to `flushing`.
absl::Status copy_frame(const Peer<v1::ArchiveService>& archive, const std::string& session,
                        const v1::Frame& frame, const fs::path& path, FlushQueue& flushing) {
  GW_ASSIGN_OR_RETURN(FileWriter file, FileWriter::create(path));
  grpc::ClientContext context;
  set_deadline(context, kLongCallTimeout);
  v1::ReadFileRequest request;
  request.set_session(session);
  request.set_file(frame.file());
  const auto reader = archive.stub->ReadFile(&context, request);
  RunningChecksum checksum;
  absl::Status written;
  for (v1::ReadFileResponse response; written.ok() && reader->Read(&response);) {
    checksum.add(response.chunk());
    written = file.add(response.chunk());
  }
  if (!written.ok()) context.TryCancel();
  const grpc::Status status = reader->Finish();
  GW_RETURN_IF_ERROR(written);
  if (!status.ok()) return status_from(status, archive.title);
  if (checksum.text() != frame.checksum()) {
    return absl::DataLossError(
        fmt::format("{} arrived damaged from the {}: its checksum is {}, the manifest says {}", frame.file(),
                    archive.title, checksum.text(), frame.checksum()));
  }
  flushing.add(std::move(file));
  return absl::OkStatus();
}

absl::Status write_frame(const Peer<v1::ArchiveService>& archive, const std::string& session,
                         const v1::Frame& frame, const fs::path& directory, FlushQueue& flushing) {
  if (interrupted()) return absl::CancelledError("the export was interrupted; nothing of it is kept");
  const fs::path file(frame.file());
  if (file.parent_path() != "frames" || !file.has_filename() || file.filename() == "..") {
    return absl::DataLossError(
        fmt::format("the {} names a frame \"{}\"; it must be in frames/", archive.title, frame.file()));
  }
  return copy_frame(archive, session, frame, directory / file, flushing);
}

// Several frames at a time, since each waits for the network.
absl::Status write_frames(const Peer<v1::ArchiveService>& archive, const v1::CaptureManifest& manifest,
                          const fs::path& directory) {
  constexpr int kAtATime = 4;
  Progress progress("exporting");
  const Interruptible ctrl_c;
  std::mutex mutex;
  int begun = 0, written = 0;
  absl::Status status;
  const auto work = [&] {
    FlushQueue flushing;
    std::unique_lock lock(mutex);
    while (status.ok() && begun < manifest.frames_size()) {
      const v1::Frame& frame = manifest.frames(begun++);
      lock.unlock();
      const absl::Status one = write_frame(archive, manifest.session(), frame, directory, flushing);
      lock.lock();
      status.Update(one);
      progress.update(++written / static_cast<double>(manifest.frames_size()),
                      fmt::format("{} of {} frames", written, manifest.frames_size()));
    }
    lock.unlock();
    const absl::Status flushed = flushing.wait();
    lock.lock();
    status.Update(flushed);
  };
  std::vector<std::jthread> workers;
  for (int i = 0; i < kAtATime; ++i) workers.emplace_back(work);
  workers.clear();  // waits for them
  GW_RETURN_IF_ERROR(status);
  progress.done(fmt::format("{} frames", manifest.frames_size()));
  return absl::OkStatus();
}

bool is_being_captured(v1::SessionState state) {
  return state == v1::SESSION_STATE_CREATED || state == v1::SESSION_STATE_CAPTURING ||
         state == v1::SESSION_STATE_PAUSED;
}

}  // namespace

absl::StatusOr<v1::CaptureManifest> export_archive(const v1::Session& session, const std::string& directory) {
  if (is_being_captured(session.state())) {
    return absl::FailedPreconditionError(
        fmt::format("session {} is {}; it must be captured before it is exported", session.name(),
                    state_name(session.state())));
  }
  const Peer<v1::ArchiveService> archive("camera node at " + session.archive_address(),
                                         session.archive_address());
  v1::GetManifestRequest request;
  request.set_session(session.name());
  GW_ASSIGN_OR_RETURN(v1::GetManifestResponse answer,
                      call(archive, &v1::ArchiveService::Stub::GetManifest, request, kLongCallTimeout));
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<PartialDirectory> partial, PartialDirectory::create(directory));
  GW_RETURN_IF_ERROR(DiskRoom(partial->path()).check(session.archive_bytes()));
  GW_RETURN_IF_ERROR(write_frames(archive, answer.manifest(), partial->path()));
  GW_RETURN_IF_ERROR(partial->keep(answer.manifest()));
  return std::move(*answer.mutable_manifest());
}

namespace {

absl::Status export_session(const Client& client, const std::string& name, const std::string& directory) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::GetSessionRequest get;
  get.set_name(name);
  GW_ASSIGN_OR_RETURN(const v1::GetSessionResponse found,
                      call(server, &v1::SessionService::Stub::GetSession, get));
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, export_archive(found.session(), directory));
  if (client.json) {
    const nlohmann::ordered_json exported = {
        {"session", name}, {"directory", directory}, {"frames", manifest.frames_size()}};
    std::cout << exported.dump(1) << "\n";
  } else {
    std::cout << fmt::format("{}: {} frames of session {}\n", directory, manifest.frames_size(), name);
  }
  return absl::OkStatus();
}

}  // namespace

void add_export_command(CLI::App& app, Client& client) {
  struct Arguments {
    std::string session;
    std::string directory;
  };
  CLI::App& command =
      *app.add_subcommand("export", "Write a session's frames and manifest to a new directory.");
  command.footer("Example:\n  glasswing export vase archives/vase");
  auto arguments = std::make_shared<Arguments>();
  command.add_option("session", arguments->session, "the session's name")->required();
  command.add_option("directory", arguments->directory, "the directory to write, new or empty")->required();
  command.callback([&client, arguments] {
    client.run = [&client, arguments] {
      return export_session(client, arguments->session, arguments->directory);
    };
  });
}

}  // namespace glasswing
