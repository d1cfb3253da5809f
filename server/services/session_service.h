// SessionService and NodeService: from the wire to the server's parts and back.
#pragma once

#include <atomic>

#include "core/service/joined_calls.h"
#include "glasswing/v1/node_service.grpc.pb.h"
#include "glasswing/v1/session_service.grpc.pb.h"
#include "server/services/server.h"
#include "server/services/waits.h"

namespace glasswing {

class SessionServiceImpl final : public v1::SessionService::Service {
 public:
  explicit SessionServiceImpl(Server& server) : server_(server), waits_(server) {}
  // Ends the watches, so that the daemon can stop.
  void stop() { stopping_ = true; }

  grpc::Status CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest*,
                             v1::CreateSessionResponse*) override;
  grpc::Status EstimateSession(grpc::ServerContext*, const v1::EstimateSessionRequest*,
                               v1::EstimateSessionResponse*) override;
  grpc::Status BeginImport(grpc::ServerContext*, const v1::BeginImportRequest*,
                           v1::BeginImportResponse*) override;
  grpc::Status FinishImport(grpc::ServerContext*, const v1::FinishImportRequest*,
                            v1::FinishImportResponse*) override;
  grpc::Status UploadImage(grpc::ServerContext*, grpc::ServerReader<v1::UploadImageRequest>*,
                           v1::UploadImageResponse*) override;
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                            v1::ListSessionsResponse*) override;
  grpc::Status ListMethods(grpc::ServerContext*, const v1::ListMethodsRequest*,
                           v1::ListMethodsResponse*) override;
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest*,
                          v1::GetSessionResponse*) override;
  grpc::Status WatchSession(grpc::ServerContext*, const v1::WatchSessionRequest*,
                            grpc::ServerWriter<v1::WatchSessionResponse>*) override;
  grpc::Status WatchSteps(grpc::ServerContext*, const v1::WatchStepsRequest*,
                          grpc::ServerWriter<v1::WatchStepsResponse>*) override;
  grpc::Status PauseSession(grpc::ServerContext*, const v1::PauseSessionRequest*,
                            v1::PauseSessionResponse*) override;
  grpc::Status ResumeSession(grpc::ServerContext*, const v1::ResumeSessionRequest*,
                             v1::ResumeSessionResponse*) override;
  grpc::Status CancelSession(grpc::ServerContext*, const v1::CancelSessionRequest*,
                             v1::CancelSessionResponse*) override;
  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest*,
                             v1::DeleteSessionResponse*) override;
  grpc::Status AnnotateSession(grpc::ServerContext*, const v1::AnnotateSessionRequest*,
                               v1::AnnotateSessionResponse*) override;
  grpc::Status SolveSession(grpc::ServerContext*, const v1::SolveSessionRequest*,
                            v1::SolveSessionResponse*) override;
  grpc::Status ReplicateSession(grpc::ServerContext*, const v1::ReplicateSessionRequest*,
                                grpc::ServerWriter<v1::ReplicateSessionResponse>*) override;
  grpc::Status FetchMatte(grpc::ServerContext*, const v1::FetchMatteRequest*,
                          grpc::ServerWriter<v1::FetchMatteResponse>*) override;

 private:
  // Every answer with one session is made here.
  template <typename Response>
  grpc::Status answer(absl::StatusOr<v1::Session> session, Response* response);

  Server& server_;
  Waits waits_;
  JoinedCalls<v1::Session> creations_{0};
  std::atomic<bool> stopping_ = false;
};

class NodeServiceImpl final : public v1::NodeService::Service {
 public:
  explicit NodeServiceImpl(Server& server) : server_(server) {}
  grpc::Status Register(grpc::ServerContext*, const v1::RegisterRequest*, v1::RegisterResponse*) override;
  grpc::Status ListNodes(grpc::ServerContext*, const v1::ListNodesRequest*, v1::ListNodesResponse*) override;
  grpc::Status GetClockHistory(grpc::ServerContext*, const v1::GetClockHistoryRequest*,
                               v1::GetClockHistoryResponse*) override;
  grpc::Status ReleaseNode(grpc::ServerContext*, const v1::ReleaseNodeRequest*,
                           v1::ReleaseNodeResponse*) override;

 private:
  Server& server_;
};

}  // namespace glasswing
