#include "server/services/session_service.h"

#include <fmt/format.h>

#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "core/security/peer.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "server/rig/caller.h"
#include "server/services/pages.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

constexpr size_t kEventsOfAMessage = 1000;

MatteRegion region_of(const v1::MatteRegion& region) {
  return {.x_px = region.x_px(),
          .y_px = region.y_px(),
          .width_px = region.width_px(),
          .height_px = region.height_px()};
}

bool rests(const v1::Session& session) {
  const v1::SessionState state = session.state();
  return state == v1::SESSION_STATE_PAUSED ||
         (state == v1::SESSION_STATE_CAPTURED && !session.solve_follows()) ||
         state == v1::SESSION_STATE_DONE || state == v1::SESSION_STATE_FAILED ||
         state == v1::SESSION_STATE_CANCELLED;
}

}  // namespace

template <typename Response>
grpc::Status SessionServiceImpl::answer(absl::StatusOr<v1::Session> session, Response* response) {
  if (!session.ok()) return to_grpc(session.status());
  *response->mutable_session() = waits_.told(with_allowed_actions(*std::move(session)));
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::CreateSession(grpc::ServerContext* context,
                                               const v1::CreateSessionRequest* request,
                                               v1::CreateSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  // A client repeats a call that is not answered in time, while the first may still be running.
  return answer(creations_.run(*context, request->request_id(),
                               [&] { return server_.captures().create(*request, caller_of(*context)); }),
                response);
}

grpc::Status SessionServiceImpl::EstimateSession(grpc::ServerContext*,
                                                 const v1::EstimateSessionRequest* request,
                                                 v1::EstimateSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<v1::EstimateSessionResponse> estimate = server_.captures().estimate(*request);
  if (!estimate.ok()) return to_grpc(estimate.status());
  *response = *std::move(estimate);
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::BeginImport(grpc::ServerContext* context,
                                             const v1::BeginImportRequest* request,
                                             v1::BeginImportResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<v1::BeginImportResponse> begun = server_.importer().begin(*request, caller_of(*context));
  if (!begun.ok()) return to_grpc(begun.status());
  response->set_import_token(begun->import_token());
  return answer(std::move(*begun->mutable_session()), response);
}

grpc::Status SessionServiceImpl::FinishImport(grpc::ServerContext*, const v1::FinishImportRequest* request,
                                              v1::FinishImportResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(server_.importer().finish(request->name()), response);
}

grpc::Status SessionServiceImpl::UploadImage(grpc::ServerContext*,
                                             grpc::ServerReader<v1::UploadImageRequest>* reader,
                                             v1::UploadImageResponse* response) {
  absl::StatusOr<ImageFiles::Upload> upload = server_.images().begin();
  if (!upload.ok()) return to_grpc(upload.status());
  v1::UploadImageRequest request;
  while (reader->Read(&request)) {
    const absl::Status added = upload->add(request.chunk());
    if (!added.ok()) return to_grpc(added);
  }
  const absl::StatusOr<std::string> image = upload->finish();
  if (!image.ok()) return to_grpc(image.status());
  response->set_image(*image);
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest* request,
                                              v1::ListSessionsResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<Page> page = Page::of(*request);
  if (!page.ok()) return to_grpc(page.status());
  const absl::StatusOr<std::vector<v1::Session>> sessions = server_.sessions().list(*request);
  if (!sessions.ok()) return to_grpc(sessions.status());
  for (const v1::Session& session : *sessions) *response->add_sessions() = waits_.told(session);
  page->cut(*response->mutable_sessions());
  response->set_next_page_token(page->next_token());
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::ListMethods(grpc::ServerContext*, const v1::ListMethodsRequest*,
                                             v1::ListMethodsResponse* response) {
  for (const SolvingMethod& known : solving_methods()) {
    v1::SolveMethod& method = *response->add_methods();
    method.set_name(std::string(known.name));
    for (const MethodOption& option : known.options) {
      v1::SolveOption& told = *method.add_options();
      told.set_name(std::string(option.name));
      told.set_usual(std::string(option.usual));
      told.set_help(std::string(option.help));
      told.set_low(option.low);
      told.set_high(option.high);
      told.set_whole(option.whole);
      for (const std::string_view choice : option.choices) told.add_choices(std::string(choice));
      told.set_only_with(std::string(option.only_with));
    }
  }
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                                            v1::GetSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<v1::Session> session = server_.sessions().find_any(request->name());
  if (session.ok()) session = server_.sessions().judged(*std::move(session));
  return answer(std::move(session), response);
}

grpc::Status SessionServiceImpl::WatchSession(grpc::ServerContext* context,
                                              const v1::WatchSessionRequest* request,
                                              grpc::ServerWriter<v1::WatchSessionResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  std::int64_t seen = 0;
  std::string last;
  while (!context->IsCancelled() && !stopping_) {
    // Also without a change of the session: what it is waiting for may have changed.
    seen = std::max<std::int64_t>(
        server_.sessions().wait_change(seen, std::chrono::milliseconds(seen == 0 ? 0 : 500)), 1);
    v1::WatchSessionResponse response;
    const grpc::Status found = answer(server_.sessions().find_any(request->name()), &response);
    if (!found.ok()) return found;
    const std::string bytes = response.SerializeAsString();
    if (bytes != last && !writer->Write(response)) break;
    last = bytes;
    if (rests(response.session())) return grpc::Status::OK;
  }
  return grpc::Status(grpc::StatusCode::UNAVAILABLE, "the server is stopping");
}

grpc::Status SessionServiceImpl::WatchSteps(grpc::ServerContext* context,
                                            const v1::WatchStepsRequest* request,
                                            grpc::ServerWriter<v1::WatchStepsResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  size_t told = 0;
  std::int64_t seen = 0;
  while (!context->IsCancelled() && !stopping_) {
    seen = std::max<std::int64_t>(
        server_.sessions().wait_change(seen, std::chrono::milliseconds(seen == 0 ? 0 : 500)), 1);
    const absl::StatusOr<v1::Session> session =
        server_.sessions().find(request->name());  // before its last events are read
    if (!session.ok()) return to_grpc(session.status());
    const absl::StatusOr<std::vector<v1::StepEvent>> events = server_.captures().steps(request->name(), told);
    if (!events.ok()) return to_grpc(events.status());
    for (size_t at = 0; at < events->size(); at += kEventsOfAMessage) {
      v1::WatchStepsResponse response;
      for (size_t i = at; i < std::min(at + kEventsOfAMessage, events->size()); ++i)
        *response.add_events() = (*events)[i];
      if (!writer->Write(response)) return grpc::Status::CANCELLED;
    }
    told += events->size();
    if (session->state() != v1::SESSION_STATE_CAPTURING) return grpc::Status::OK;
  }
  return grpc::Status(grpc::StatusCode::UNAVAILABLE, "the server is stopping");
}

grpc::Status SessionServiceImpl::PauseSession(grpc::ServerContext* context,
                                              const v1::PauseSessionRequest* request,
                                              v1::PauseSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(server_.control().pause(request->name(), caller_of(*context)), response);
}

grpc::Status SessionServiceImpl::ResumeSession(grpc::ServerContext* context,
                                               const v1::ResumeSessionRequest* request,
                                               v1::ResumeSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(server_.control().resume(*request, caller_of(*context)), response);
}

grpc::Status SessionServiceImpl::CancelSession(grpc::ServerContext* context,
                                               const v1::CancelSessionRequest* request,
                                               v1::CancelSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(server_.control().cancel(request->name(), caller_of(*context)), response);
}

grpc::Status SessionServiceImpl::DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest* request,
                                               v1::DeleteSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<std::int64_t> freed_bytes =
      server_.storage().remove(request->name(), request->trash(), *response->mutable_ends());
  if (!freed_bytes.ok()) return to_grpc(freed_bytes.status());
  response->set_freed_bytes(*freed_bytes);
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::AnnotateSession(grpc::ServerContext*,
                                                 const v1::AnnotateSessionRequest* request,
                                                 v1::AnnotateSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(server_.sessions().annotate(*request), response);
}

grpc::Status SessionServiceImpl::SolveSession(grpc::ServerContext*, const v1::SolveSessionRequest* request,
                                              v1::SolveSessionResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(server_.control().solve(*request), response);
}

grpc::Status SessionServiceImpl::ReplicateSession(grpc::ServerContext* context,
                                                  const v1::ReplicateSessionRequest* request,
                                                  grpc::ServerWriter<v1::ReplicateSessionResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(server_.replicator().replicate(
      *request, [&](const v1::ReplicateSessionResponse& progress) { return writer->Write(progress); },
      [&] { return !context->IsCancelled() && !stopping_; }));
}

grpc::Status SessionServiceImpl::FetchMatte(grpc::ServerContext*, const v1::FetchMatteRequest* request,
                                            grpc::ServerWriter<v1::FetchMatteResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  const std::optional<int> frame = request->has_frame() ? std::optional<int>(request->frame()) : std::nullopt;
  if (request->max_pixels() < 0) {
    return to_grpc(absl::InvalidArgumentError(
        fmt::format("max_pixels is {}; it must be 1 or more, or 0 for all", request->max_pixels())));
  }
  MattePart part{.region = std::nullopt, .max_pixels = request->max_pixels()};
  if (request->has_region()) part.region = region_of(request->region());
  const absl::StatusOr<StoredMatte> matte = request->partial()
                                                ? server_.solves().open_partial_matte(request->name(), part)
                                                : server_.solves().open_matte(request->name(), frame, part);
  if (!matte.ok()) return to_grpc(matte.status());
  return to_grpc(matte->send([&](std::string_view chunk) {
    v1::FetchMatteResponse response;
    response.set_chunk(chunk.data(), chunk.size());
    return writer->Write(response);
  }));
}

grpc::Status NodeServiceImpl::Register(grpc::ServerContext* context, const v1::RegisterRequest* request,
                                       v1::RegisterResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(server_.rig().add(*request, peer_of(*context->auth_context())));
}

grpc::Status NodeServiceImpl::ReleaseNode(grpc::ServerContext*, const v1::ReleaseNodeRequest* request,
                                          v1::ReleaseNodeResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(server_.rig().release(request->name()));
}

grpc::Status NodeServiceImpl::ListNodes(grpc::ServerContext*, const v1::ListNodesRequest* request,
                                        v1::ListNodesResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<Page> page = Page::of(*request);
  if (!page.ok()) return to_grpc(page.status());
  for (const v1::Node& node : server_.rig().nodes()) *response->add_nodes() = node;
  page->cut(*response->mutable_nodes());
  response->set_next_page_token(page->next_token());
  if (const auto holder = server_.rig_lock().holder()) *response->mutable_holder() = *holder;
  for (const std::string& problem : server_.problems().all()) response->add_problems(problem);
  return grpc::Status::OK;
}

grpc::Status NodeServiceImpl::GetClockHistory(grpc::ServerContext*, const v1::GetClockHistoryRequest* request,
                                              v1::GetClockHistoryResponse* response) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<std::vector<v1::ClockOffset>> history = server_.rig().clock_history(request->node());
  if (!history.ok()) return to_grpc(history.status());
  for (const v1::ClockOffset& offset : *history) *response->add_offsets() = offset;
  return grpc::Status::OK;
}

}  // namespace glasswing
