// QueueService: from the wire to the CaptureQueue and back.
#pragma once

#include "glasswing/v1/queue_service.grpc.pb.h"
#include "server/services/server.h"

namespace glasswing {

class QueueServiceImpl final : public v1::QueueService::Service {
 public:
  explicit QueueServiceImpl(Server& server) : queue_(server.queue()) {}

  grpc::Status AddQueueItem(grpc::ServerContext*, const v1::AddQueueItemRequest*,
                            v1::AddQueueItemResponse*) override;
  grpc::Status GetQueue(grpc::ServerContext*, const v1::GetQueueRequest*, v1::GetQueueResponse*) override;
  grpc::Status GetQueueItem(grpc::ServerContext*, const v1::GetQueueItemRequest*,
                            v1::GetQueueItemResponse*) override;
  grpc::Status EditQueueItem(grpc::ServerContext*, const v1::EditQueueItemRequest*,
                             v1::EditQueueItemResponse*) override;
  grpc::Status MoveQueueItem(grpc::ServerContext*, const v1::MoveQueueItemRequest*,
                             v1::MoveQueueItemResponse*) override;
  grpc::Status DuplicateQueueItem(grpc::ServerContext*, const v1::DuplicateQueueItemRequest*,
                                  v1::DuplicateQueueItemResponse*) override;
  grpc::Status RemoveQueueItem(grpc::ServerContext*, const v1::RemoveQueueItemRequest*,
                               v1::RemoveQueueItemResponse*) override;
  grpc::Status RunQueueItem(grpc::ServerContext*, const v1::RunQueueItemRequest*,
                            v1::RunQueueItemResponse*) override;
  grpc::Status ApproveQueueItem(grpc::ServerContext*, const v1::ApproveQueueItemRequest*,
                                v1::ApproveQueueItemResponse*) override;
  grpc::Status SetQueue(grpc::ServerContext*, const v1::SetQueueRequest*, v1::SetQueueResponse*) override;
  grpc::Status HoldQueue(grpc::ServerContext* context, const v1::HoldQueueRequest* request,
                         v1::HoldQueueResponse* response) override;
  grpc::Status ReleaseQueue(grpc::ServerContext* context, const v1::ReleaseQueueRequest* request,
                            v1::ReleaseQueueResponse* response) override;
  grpc::Status ListQueueHistory(grpc::ServerContext*, const v1::ListQueueHistoryRequest*,
                                v1::ListQueueHistoryResponse*) override;
  grpc::Status FetchComposite(grpc::ServerContext*, const v1::FetchCompositeRequest*,
                              grpc::ServerWriter<v1::FetchCompositeResponse>*) override;

 private:
  CaptureQueue& queue_;
};

}  // namespace glasswing
