// The server's imports: sessions of frames that somebody else captured.
#include "core/base/fault_point.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/service/service.h"
#include "server/archives/session_archive.h"
#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"

namespace glasswing {

absl::StatusOr<v1::Session> Server::begin_import(const v1::BeginImportRequest& request,
                                                 const Caller& caller) {
  GW_RETURN_IF_ERROR(check_name("session", request.name()));
  GW_ASSIGN_OR_RETURN(const v1::Node camera, rig_.camera());
  v1::Session session;
  session.set_name(request.name());
  session.set_created(utc_now_rfc3339());
  session.set_started_by(caller.client);
  session.set_state(v1::SESSION_STATE_CREATED);
  session.set_reason("frames are being imported");
  session.set_archive_address(camera.address());
  const v1::Camera& shape = request.manifest().camera();
  session.set_pixel_count(static_cast<std::int64_t>(shape.width_px()) * shape.height_px());

  const NodeLink link(camera);
  v1::CreateArchiveRequest create;
  *create.mutable_manifest() = request.manifest();
  create.mutable_manifest()->set_session(request.name());
  create.mutable_manifest()->clear_frames();
  v1::CreateArchiveResponse created;
  {
    const std::lock_guard lock(mutex_);
    GW_RETURN_IF_ERROR(check_stays(request.name()));
    const absl::StatusOr<v1::Session> before = catalogue_->find(request.name());
    // An import that broke off may be taken up again; anything else keeps its name.
    const bool again = before.ok() && before->state() == v1::SESSION_STATE_CREATED && !before->has_plan();
    if (!again) GW_RETURN_IF_ERROR(catalogue_->insert(session, ""));
    fault_point("session stored");
    announce();
  }
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(10));
  GW_RETURN_IF_ERROR(from_grpc(
      v1::ArchiveService::NewStub(link.channel())->CreateArchive(&context, create, &created), link.title()));
  return session;
}

absl::StatusOr<v1::Session> Server::finish_import(const std::string& name) {
  GW_ASSIGN_OR_RETURN(v1::Session session, catalogue_->find(name));
  if (session.state() == v1::SESSION_STATE_CAPTURED) return session;
  if (session.state() != v1::SESSION_STATE_CREATED || session.has_plan()) return not_now(session, "imported");
  SessionArchive archive(session);
  GW_RETURN_IF_ERROR(archive.seal());
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, archive.manifest());
  session.set_method(usual_method(manifest));
  note_video(manifest, session);
  note_frames(manifest, session);
  session.set_state(v1::SESSION_STATE_CAPTURED);
  session.clear_reason();
  const std::lock_guard lock(mutex_);
  // It may have been cancelled meanwhile.
  GW_ASSIGN_OR_RETURN(const v1::Session now, find_locked(name));
  if (now.state() != v1::SESSION_STATE_CREATED) return not_now(now, "imported");
  fault_point("import sealed");
  GW_RETURN_IF_ERROR(change(session));
  fault_point("session captured");
  return session;
}

}  // namespace glasswing
