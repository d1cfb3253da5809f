// WorkService, called by solvers.
#pragma once

#include "glasswing/v1/work_service.grpc.pb.h"
#include "server/services/server.h"

namespace glasswing {

class WorkServiceImpl final : public v1::WorkService::Service {
 public:
  explicit WorkServiceImpl(Server& server) : server_(server) {}
  grpc::Status ClaimTile(grpc::ServerContext*, const v1::ClaimTileRequest*, v1::ClaimTileResponse*) override;
  grpc::Status KeepTile(grpc::ServerContext*, const v1::KeepTileRequest*, v1::KeepTileResponse*) override;
  grpc::Status CompleteTile(grpc::ServerContext*, grpc::ServerReader<v1::CompleteTileRequest>*,
                            v1::CompleteTileResponse*) override;
  grpc::Status CompleteSurvey(grpc::ServerContext*, const v1::CompleteSurveyRequest*,
                              v1::CompleteSurveyResponse*) override;
  grpc::Status FailTile(grpc::ServerContext*, const v1::FailTileRequest*, v1::FailTileResponse*) override;

 private:
  // PERMISSION_DENIED: the solver of this name has another certificate.
  absl::Status check_solver(const grpc::ServerContext& context, const std::string& name) const;

  Server& server_;
};

}  // namespace glasswing
