#include "server/session_service.h"

#include <fmt/format.h>

#include "core/base/file.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

constexpr size_t kMaxImageBytes = 256u << 20;

bool rests(v1::SessionState state) {
  return state == v1::SESSION_STATE_PAUSED || state == v1::SESSION_STATE_CAPTURED ||
         state == v1::SESSION_STATE_DONE || state == v1::SESSION_STATE_FAILED ||
         state == v1::SESSION_STATE_CANCELLED;
}

template <typename Response>
grpc::Status answer(const absl::StatusOr<v1::Session>& session, Response* response) {
  if (!session.ok()) return to_grpc(session.status());
  *response->mutable_session() = *session;
  return grpc::Status::OK;
}

}  // namespace

grpc::Status SessionServiceImpl::CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest* request,
                                               v1::CreateSessionResponse* response) {
  return answer(server_.create(*request), response);
}

grpc::Status SessionServiceImpl::BeginImport(grpc::ServerContext*, const v1::BeginImportRequest* request,
                                             v1::BeginImportResponse* response) {
  return answer(server_.begin_import(*request), response);
}

grpc::Status SessionServiceImpl::FinishImport(grpc::ServerContext*, const v1::FinishImportRequest* request,
                                              v1::FinishImportResponse* response) {
  return answer(server_.finish_import(request->name()), response);
}

grpc::Status SessionServiceImpl::UploadImage(grpc::ServerContext*,
                                             grpc::ServerReader<v1::UploadImageRequest>* reader,
                                             v1::UploadImageResponse* response) {
  std::string bytes;
  v1::UploadImageRequest request;
  while (reader->Read(&request)) {
    bytes += request.chunk();
    if (bytes.size() > kMaxImageBytes) {
      return to_grpc(
          absl::InvalidArgumentError(fmt::format("the image is larger than {} bytes", kMaxImageBytes)));
    }
  }
  const absl::StatusOr<std::string> image = server_.store_image(bytes);
  if (!image.ok()) return to_grpc(image.status());
  response->set_image(*image);
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                                              v1::ListSessionsResponse* response) {
  const absl::StatusOr<std::vector<v1::Session>> sessions = server_.list();
  if (!sessions.ok()) return to_grpc(sessions.status());
  for (const v1::Session& session : *sessions) *response->add_sessions() = session;
  return grpc::Status::OK;
}

grpc::Status SessionServiceImpl::GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                                            v1::GetSessionResponse* response) {
  return answer(server_.find(request->name()), response);
}

grpc::Status SessionServiceImpl::WatchSession(grpc::ServerContext* context,
                                              const v1::WatchSessionRequest* request,
                                              grpc::ServerWriter<v1::WatchSessionResponse>* writer) {
  std::int64_t seen = 0;
  std::string last;
  while (!context->IsCancelled() && !stopping_) {
    const std::int64_t now = server_.wait_change(seen, std::chrono::milliseconds(seen == 0 ? 0 : 500));
    if (now == seen && seen != 0) continue;
    seen = std::max<std::int64_t>(now, 1);
    const absl::StatusOr<v1::Session> session = server_.find(request->name());
    if (!session.ok()) return to_grpc(session.status());
    const std::string bytes = session->SerializeAsString();
    if (bytes != last) {
      v1::WatchSessionResponse response;
      *response.mutable_session() = *session;
      if (!writer->Write(response)) break;
      last = bytes;
    }
    if (rests(session->state())) return grpc::Status::OK;
  }
  return grpc::Status(grpc::StatusCode::UNAVAILABLE, "the server is stopping");
}

grpc::Status SessionServiceImpl::PauseSession(grpc::ServerContext*, const v1::PauseSessionRequest* request,
                                              v1::PauseSessionResponse* response) {
  return answer(server_.pause(request->name()), response);
}

grpc::Status SessionServiceImpl::ResumeSession(grpc::ServerContext*, const v1::ResumeSessionRequest* request,
                                               v1::ResumeSessionResponse* response) {
  return answer(server_.resume(request->name()), response);
}

grpc::Status SessionServiceImpl::CancelSession(grpc::ServerContext*, const v1::CancelSessionRequest* request,
                                               v1::CancelSessionResponse* response) {
  return answer(server_.cancel(request->name()), response);
}

grpc::Status SessionServiceImpl::SolveSession(grpc::ServerContext*, const v1::SolveSessionRequest* request,
                                              v1::SolveSessionResponse* response) {
  return answer(server_.solve(*request), response);
}

grpc::Status SessionServiceImpl::FetchMatte(grpc::ServerContext*, const v1::FetchMatteRequest* request,
                                            grpc::ServerWriter<v1::FetchMatteResponse>* writer) {
  const std::optional<int> frame = request->has_frame() ? std::optional<int>(request->frame()) : std::nullopt;
  const absl::StatusOr<std::filesystem::path> path = server_.matte(request->name(), frame);
  if (!path.ok()) return to_grpc(path.status());
  const absl::StatusOr<std::string> bytes = read_file(*path);
  if (!bytes.ok()) return to_grpc(absl::DataLossError(bytes.status().message()));
  for (size_t at = 0; at < bytes->size(); at += kChunkBytes) {
    v1::FetchMatteResponse response;
    response.set_chunk(bytes->substr(at, kChunkBytes));
    if (!writer->Write(response)) break;
  }
  return grpc::Status::OK;
}

grpc::Status NodeServiceImpl::Register(grpc::ServerContext*, const v1::RegisterRequest* request,
                                       v1::RegisterResponse*) {
  return to_grpc(server_.rig().add(*request));
}

grpc::Status NodeServiceImpl::ListNodes(grpc::ServerContext*, const v1::ListNodesRequest*,
                                        v1::ListNodesResponse* response) {
  for (const v1::Node& node : server_.rig().nodes()) *response->add_nodes() = node;
  return grpc::Status::OK;
}

}  // namespace glasswing
