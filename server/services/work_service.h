// WorkService, called by solvers.
#pragma once

#include "core/service/joined_calls.h"
#include "glasswing/v1/work_service.grpc.pb.h"
#include "server/dispatch/lease_seal.h"
#include "server/services/server.h"

namespace glasswing {

class WorkServiceImpl final : public v1::WorkService::Service {
 public:
  explicit WorkServiceImpl(Server& server) : server_(server), seal_(server.jobs()) {}
  grpc::Status ClaimTile(grpc::ServerContext*, const v1::ClaimTileRequest*, v1::ClaimTileResponse*) override;
  grpc::Status KeepTile(grpc::ServerContext*, const v1::KeepTileRequest*, v1::KeepTileResponse*) override;
  grpc::Status CompleteTile(grpc::ServerContext*, grpc::ServerReader<v1::CompleteTileRequest>*,
                            v1::CompleteTileResponse*) override;
  grpc::Status CompleteSurvey(grpc::ServerContext*, const v1::CompleteSurveyRequest*,
                              v1::CompleteSurveyResponse*) override;
  grpc::Status FailTile(grpc::ServerContext*, const v1::FailTileRequest*, v1::FailTileResponse*) override;

 private:
  // PERMISSION_DENIED: the solver with this name has a different certificate.
  absl::Status check_solver(const grpc::ServerContext& context, const std::string& name) const;
  // The same, and ABORTED: the lease is not the caller's.
  absl::Status check_lease(const grpc::ServerContext& context, const std::string& name,
                           const v1::TileLease& lease);
  // Waits for a tile, as long as the request allows.
  absl::StatusOr<v1::ClaimTileResponse> claim(const grpc::ServerContext& context,
                                              const v1::ClaimTileRequest& request);

  Server& server_;
  LeaseSeal seal_;
  JoinedCalls<v1::ClaimTileResponse> claims_{NodeRegistry::kMaxNodes};
  JoinedCalls<v1::CompleteTileResponse> results_{0};    // by attempt
  JoinedCalls<v1::CompleteSurveyResponse> surveys_{0};  // by attempt
};

}  // namespace glasswing
