#include "server/archives/importer.h"

#include <fmt/format.h>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/fault_point.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "server/archives/session_archive.h"
#include "server/rig/rig_link.h"
#include "server/sessions/archive_facts.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

// Frames may be put into an import until it is finished. A newly created capture has a plan.
bool is_being_imported(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_CREATED && !session.has_plan();
}

}  // namespace

absl::StatusOr<v1::BeginImportResponse> Importer::begin(const v1::BeginImportRequest& request,
                                                        const Caller& caller) {
  GW_RETURN_IF_ERROR(check_name("session", request.name()));
  GW_ASSIGN_OR_RETURN(const v1::Node camera, nodes_.camera(request.camera()));
  v1::BeginImportResponse response;
  response.set_import_token(random_token());
  v1::Session& session = *response.mutable_session();
  session.set_name(request.name());
  session.set_created(utc_now_rfc3339());
  session.set_started_by(caller.client);
  session.set_state(v1::SESSION_STATE_CREATED);
  session.set_reason("frames are being imported");
  session.set_archive_address(camera.address());
  const v1::Camera& shape = request.manifest().camera();
  session.set_pixel_count(static_cast<std::int64_t>(shape.width_px()) * shape.height_px());
  bool again = false;
  {
    SessionStore::Edit edit = sessions_.edit();
    GW_RETURN_IF_ERROR(edit.check_stays(request.name()));
    const absl::StatusOr<v1::Session> before = sessions_.stored(request.name());
    again = before.ok() && is_being_imported(*before);
    if (!again) GW_RETURN_IF_ERROR(edit.insert(session, ""));
    fault_point("session stored");
    edit.announce();
  }
  const NodeLink link(camera);
  v1::CreateArchiveRequest create;
  *create.mutable_manifest() = request.manifest();
  create.mutable_manifest()->set_session(request.name());
  create.mutable_manifest()->clear_frames();
  create.set_import_token(response.import_token());
  v1::CreateArchiveResponse created;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(10));
  const absl::Status begun = from_grpc(
      v1::ArchiveService::NewStub(link.channel())->CreateArchive(&context, create, &created), link.title());
  if (begun.ok()) return response;
  // A rejected import leaves nothing behind. If there was no answer the archive may exist: the import can be
  // repeated, or deleted.
  if (!again && absl::IsInvalidArgument(begun)) {
    SessionStore::Edit edit = sessions_.edit();
    const absl::StatusOr<v1::Session> now = edit.find(request.name());
    if (now.ok() && is_being_imported(*now)) GW_RETURN_IF_ERROR(edit.remove(request.name()));
    edit.announce();
  }
  return begun;
}

absl::StatusOr<v1::Session> Importer::finish(const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::Session session, sessions_.stored(name));
  if (session.state() == v1::SESSION_STATE_CAPTURED) return session;
  if (!is_being_imported(session)) return not_now(session, "imported");
  SessionArchive archive(session);
  GW_ASSIGN_OR_RETURN(v1::CaptureManifest manifest, archive.manifest());
  if (manifest.frames().empty()) {
    return absl::FailedPreconditionError(
        fmt::format("no frame of the import of session \"{}\" has arrived; send some, or delete it", name));
  }
  GW_RETURN_IF_ERROR(archive.seal());
  GW_ASSIGN_OR_RETURN(manifest, archive.manifest());
  session.set_method(usual_method(manifest));
  note_video(manifest, session);
  note_frames(manifest, session);
  session.set_state(v1::SESSION_STATE_CAPTURED);
  session.clear_reason();
  SessionStore::Edit edit = sessions_.edit();
  // It may have been cancelled or deleted meanwhile.
  GW_RETURN_IF_ERROR(edit.check_stays(name));
  GW_ASSIGN_OR_RETURN(const v1::Session now, edit.find(name));
  if (now.state() != v1::SESSION_STATE_CREATED) return not_now(now, "imported");
  fault_point("import sealed");
  GW_RETURN_IF_ERROR(edit.change(session));
  fault_point("session captured");
  return session;
}

}  // namespace glasswing
