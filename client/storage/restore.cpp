#include <fmt/format.h>

#include <iostream>

#include "client/cli/rpc.h"
#include "client/cli/session_text.h"
#include "client/exchange/import.h"
#include "client/solve/put_parts.h"
#include "client/storage/archive_location.h"
#include "client/storage/checksum_list.h"
#include "client/storage/commands.h"
#include "client/storage/session_record.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/cli/interrupt.h"
#include "core/cli/progress.h"
#include "core/matte/row_part.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

struct RestoreArguments {
  std::string archive, session, camera;
};

// The matte belongs to the frames as the node has them now.
absl::StatusOr<v1::Session> put_back(const Client& client, const v1::Session& session,
                                     const SessionRecord& record, const fs::path& matte) {
  const Peer<v1::ArchiveService> archive("camera node at " + session.archive_address(),
                                         session.archive_address());
  v1::GetManifestRequest request;
  request.set_session(session.name());
  GW_ASSIGN_OR_RETURN(const v1::GetManifestResponse now,
                      call(archive, &v1::ArchiveService::Stub::GetManifest, request, kLongCallTimeout));
  v1::PutMatteRequest header;
  header.set_name(session.name());
  header.set_archive(archive_digest(now.manifest()));
  header.set_computes(record.computes);
  header.set_seconds(record.session.solve_seconds());
  return put_matte(client, std::move(header), matte);
}

absl::StatusOr<v1::Session> annotate(const Client& client, const std::string& name,
                                     const v1::Session& recorded) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::AnnotateSessionRequest request;
  request.set_name(name);
  request.set_note(recorded.note());
  *request.mutable_add_tags() = recorded.tags();
  GW_ASSIGN_OR_RETURN(v1::AnnotateSessionResponse annotated,
                      call(server, &v1::SessionService::Stub::AnnotateSession, request));
  return std::move(*annotated.mutable_session());
}

absl::Status restore_from(const Client& client, const fs::path& directory,
                          const RestoreArguments& arguments) {
  GW_RETURN_IF_ERROR(check_checksum_list(directory, arguments.archive));
  GW_ASSIGN_OR_RETURN(const SessionRecord record, read_session_record(directory));
  const std::string name = arguments.session.empty() ? record.session.name() : arguments.session;
  GW_RETURN_IF_ERROR(check_name("session", name));
  GW_ASSIGN_OR_RETURN(v1::Session session, import_archive(client, directory, name, arguments.camera));
  GW_ASSIGN_OR_RETURN(session, annotate(client, name, record.session));
  const fs::path matte = directory / kArchivedMatte;
  std::error_code ignored;
  std::string left_out;
  if (fs::exists(matte, ignored) && name != record.session.name()) {
    left_out = fmt::format("its matte is of session {}", record.session.name());
  } else if (fs::exists(matte, ignored)) {
    const absl::StatusOr<v1::Session> put = put_back(client, session, record, matte);
    if (put.ok()) session = *put;
    if (absl::IsFailedPrecondition(put.status())) {
      left_out = std::string(put.status().message());
    } else if (!put.ok()) {
      return put.status();
    }
  } else if (fs::exists(directory / kArchivedMattes, ignored)) {
    left_out = "it is a video, whose mattes stay in the archive";
  }
  print_session(session, client.json);
  if (!left_out.empty())
    std::cerr << fmt::format(
        "warning: the frames are restored, not the matte: {}; solve it again: glasswing solve {}\n", left_out,
        name);
  return absl::OkStatus();
}

absl::Status restore(const Client& client, const RestoreArguments& arguments) {
  const Interruptible ctrl_c;
  GW_ASSIGN_OR_RETURN(const ArchiveLocation from, ArchiveLocation::parse(arguments.archive));
  if (!from.is_remote()) return restore_from(client, from.location(), arguments);
  GW_ASSIGN_OR_RETURN(const ScratchDirectory here, ScratchDirectory::create());
  {
    Waiting waiting("downloading");
    GW_RETURN_IF_ERROR(from.download(here.path()));
  }
  return restore_from(client, here.path(), arguments);
}

}  // namespace

void add_restore_command(CLI::App& app, Client& client) {
  CLI::App& command =
      *app.add_subcommand("restore", "Make a session of an archive that glasswing archive wrote.");
  command.footer(
      "Every file is checked before the first is sent; a damaged one is named, and nothing is restored. "
      "Frames and matte are\nthe same bytes as before, with tags and note. As any imported session it can be "
      "solved, but not captured further.\n\n"
      "Examples:\n  glasswing restore /srv/archives/vase\n  glasswing restore s3://lab-archive/2026/vase-1\n"
      "  glasswing restore rclone:lab:archive/vase --session vase-again");
  auto arguments = std::make_shared<RestoreArguments>();
  command
      .add_option("archive", arguments->archive,
                  "its directory, s3://BUCKET/PATH/NAME or rclone:REMOTE:PATH/NAME")
      ->required();
  command.add_option("--session", arguments->session, "another name; the matte is not restored then");
  command
      .add_option("--camera", arguments->camera,
                  "the camera node to store the frames; needed if several are up")
      ->type_name("NODE");
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return restore(client, *arguments); }; });
}

}  // namespace glasswing
