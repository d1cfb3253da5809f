// StorageService.
#pragma once

#include "glasswing/v1/storage_service.grpc.pb.h"
#include "server/archives/storage_keeper.h"

namespace glasswing {

class StorageServiceImpl final : public v1::StorageService::Service {
 public:
  explicit StorageServiceImpl(StorageKeeper& storage) : storage_(storage) {}
  grpc::Status GetUsage(grpc::ServerContext* context, const v1::GetUsageRequest* request,
                        v1::GetUsageResponse* response) override;
  grpc::Status UndeleteSession(grpc::ServerContext* context, const v1::UndeleteSessionRequest* request,
                               v1::UndeleteSessionResponse* response) override;
  grpc::Status ApplyRetention(grpc::ServerContext* context, const v1::ApplyRetentionRequest* request,
                              v1::ApplyRetentionResponse* response) override;

 private:
  StorageKeeper& storage_;
};

}  // namespace glasswing
