#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/exchange/export.h"
#include "client/sessions/matte_input.h"
#include "client/storage/archive_location.h"
#include "client/storage/checksum_list.h"
#include "client/storage/commands.h"
#include "client/storage/session_record.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/method/methods.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

using Sessions = Peer<v1::SessionService>;

absl::Status fetch_matte(const Sessions& server, const std::string& session, std::optional<int> frame,
                         const fs::path& path) {
  v1::FetchMatteRequest request;
  request.set_name(session);
  if (frame) request.set_frame(*frame);
  GW_ASSIGN_OR_RETURN(FileWriter writer, FileWriter::create(path));
  GW_RETURN_IF_ERROR(stream_matte(server, request, writer));
  return writer.flush();
}

// Returns the number of mattes.
absl::StatusOr<int> fetch_mattes(const Sessions& server, const v1::Session& session,
                                 const fs::path& directory) {
  if (!session.matte_ready() && session.solved_frames().empty()) return 0;
  if (!is_video(session)) {
    GW_RETURN_IF_ERROR(fetch_matte(server, session.name(), std::nullopt, directory / kArchivedMatte));
    return 1;
  }
  const fs::path mattes = directory / kArchivedMattes;
  GW_RETURN_IF_ERROR(make_directory_durably(mattes));
  for (const int frame : session.solved_frames()) {
    if (interrupted()) return absl::CancelledError("the archiving was interrupted");
    GW_RETURN_IF_ERROR(fetch_matte(server, session.name(), frame, mattes / fmt::format("{:04d}.exr", frame)));
  }
  return session.solved_frames_size();
}

// Frames, mattes, record, and the list of their checksums, which is written last.
absl::StatusOr<int> write_session(const Sessions& server, const v1::Session& session,
                                  const fs::path& directory) {
  GW_RETURN_IF_ERROR(export_archive(session, directory.string()).status());
  GW_ASSIGN_OR_RETURN(const int mattes, fetch_mattes(server, session, directory));
  GW_RETURN_IF_ERROR(write_session_record(
      {.session = session, .computes = mattes > 0 ? computes(session.method()) : ""}, directory));
  GW_RETURN_IF_ERROR(write_checksum_list(directory));
  GW_RETURN_IF_ERROR(check_checksum_list(directory, directory.string()));  // as the disk has it
  return mattes;
}

absl::StatusOr<int> archive_locally(const Sessions& server, const v1::Session& session,
                                    const ArchiveLocation& to) {
  const fs::path target = to.location_of(session.name()), partial = target.string() + ".partial";
  std::error_code error;
  fs::remove_all(partial, error);
  if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot remove {}", partial.string()));
  GW_RETURN_IF_ERROR(make_directory_durably(to.location()));
  const absl::StatusOr<int> mattes = write_session(server, session, partial);
  if (!mattes.ok()) {
    fs::remove_all(partial, error);
    return mattes;
  }
  GW_RETURN_IF_ERROR(rename_file(partial, target));
  GW_RETURN_IF_ERROR(flush_directory(to.location()));
  return mattes;
}

absl::StatusOr<int> archive_remotely(const Sessions& server, const v1::Session& session,
                                     const ArchiveLocation& to) {
  GW_ASSIGN_OR_RETURN(const ScratchDirectory here, ScratchDirectory::create());
  GW_ASSIGN_OR_RETURN(const int mattes, write_session(server, session, here.path() / session.name()));
  Waiting waiting("uploading");
  GW_RETURN_IF_ERROR(to.upload(here.path() / session.name(), session.name()));
  return mattes;
}

absl::StatusOr<v1::Session> session_named(const Sessions& server, const std::string& name) {
  v1::GetSessionRequest get;
  get.set_name(name);
  GW_ASSIGN_OR_RETURN(v1::GetSessionResponse found, call(server, &v1::SessionService::Stub::GetSession, get));
  if (!found.session().archive_address().empty()) return std::move(*found.mutable_session());
  return absl::FailedPreconditionError(
      fmt::format("session {} has no frames; its matte alone: glasswing fetch {}", name, name));
}

absl::Status archive_sessions(const Client& client, const std::vector<std::string>& names,
                              const std::string& where) {
  const Interruptible ctrl_c;
  GW_ASSIGN_OR_RETURN(const ArchiveLocation to, ArchiveLocation::parse(where));
  const Sessions server(client.server_title(), client.server);
  std::vector<v1::Session> sessions;
  for (const std::string& name : names) {
    GW_ASSIGN_OR_RETURN(sessions.emplace_back(), session_named(server, name));
    GW_RETURN_IF_ERROR(to.check_free(name));
  }
  nlohmann::ordered_json archived = nlohmann::ordered_json::array();
  for (const v1::Session& session : sessions) {
    GW_ASSIGN_OR_RETURN(const int mattes, to.is_remote() ? archive_remotely(server, session, to)
                                                         : archive_locally(server, session, to));
    const std::string at = to.location_of(session.name());
    archived.push_back({{"session", session.name()},
                        {"archive", at},
                        {"frames", session.proven_count()},
                        {"mattes", mattes}});
    if (!client.json)
      std::cout << fmt::format("{}: {} frames, {} of session {}\n", at, session.proven_count(),
                               mattes == 1 ? "the matte" : fmt::format("{} mattes", mattes), session.name());
  }
  if (client.json) std::cout << nlohmann::ordered_json{{"archived", archived}}.dump(1) << "\n";
  return absl::OkStatus();
}

}  // namespace

void add_archive_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("archive", "Write sessions with their mattes to a directory or a remote store.");
  command.footer(
      "Each becomes a directory with the frames, the mattes, session.json, and the checksums of all of them "
      "(SHA256SUMS,\nwhich sha256sum -c checks too). The session stays on the rig. s3:// needs the program "
      "s3cmd, rclone: the program rclone,\nboth set up for the store; such a session is written below TMPDIR "
      "first.\n\n"
      "Examples:\n  glasswing archive vase --to /srv/archives\n"
      "  glasswing archive vase-1 vase-2 --to s3://lab-archive/2026\n"
      "  glasswing archive vase --to rclone:lab:archive && glasswing delete vase");
  struct Arguments {
    std::vector<std::string> sessions;
    std::string to;
  };
  auto arguments = std::make_shared<Arguments>();
  command.add_option("sessions", arguments->sessions, "their names")->required();
  command.add_option("--to", arguments->to, "a directory, s3://BUCKET/PATH or rclone:REMOTE:PATH")
      ->required()
      ->type_name("WHERE");
  command.callback([&client, arguments] {
    client.run = [&client, arguments] {
      return archive_sessions(client, arguments->sessions, arguments->to);
    };
  });
}

}  // namespace glasswing
