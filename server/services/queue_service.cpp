#include "server/services/queue_service.h"

#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "server/rig/caller.h"
#include "server/services/pages.h"

namespace glasswing {
namespace {

template <typename Response>
grpc::Status answer(absl::StatusOr<v1::QueueItem> item, Response* response) {
  if (!item.ok()) return to_grpc(item.status());
  *response->mutable_item() = *std::move(item);
  return grpc::Status::OK;
}

}  // namespace

grpc::Status QueueServiceImpl::AddQueueItem(grpc::ServerContext* context,
                                            const v1::AddQueueItemRequest* request,
                                            v1::AddQueueItemResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(queue_.add(*request, caller_of(*context)), response);
}

grpc::Status QueueServiceImpl::GetQueue(grpc::ServerContext*, const v1::GetQueueRequest* request,
                                        v1::GetQueueResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<Page> page = Page::of(*request);
  if (!page.ok()) return to_grpc(page.status());
  *response->mutable_queue() = queue_.state();
  if (!request->page_token().empty()) response->mutable_queue()->clear_holds();  // pages are merged
  for (v1::QueueItem& item : queue_.list(request->ended())) *response->add_items() = std::move(item);
  page->cut(*response->mutable_items());
  response->set_next_page_token(page->next_token());
  return grpc::Status::OK;
}

grpc::Status QueueServiceImpl::GetQueueItem(grpc::ServerContext*, const v1::GetQueueItemRequest* request,
                                            v1::GetQueueItemResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(queue_.find(request->number()), response);
}

grpc::Status QueueServiceImpl::EditQueueItem(grpc::ServerContext* context,
                                             const v1::EditQueueItemRequest* request,
                                             v1::EditQueueItemResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(queue_.edit(*request, caller_of(*context)), response);
}

grpc::Status QueueServiceImpl::MoveQueueItem(grpc::ServerContext* context,
                                             const v1::MoveQueueItemRequest* request,
                                             v1::MoveQueueItemResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(queue_.move(*request, caller_of(*context)), response);
}

grpc::Status QueueServiceImpl::DuplicateQueueItem(grpc::ServerContext* context,
                                                  const v1::DuplicateQueueItemRequest* request,
                                                  v1::DuplicateQueueItemResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(queue_.duplicate(*request, caller_of(*context)), response);
}

grpc::Status QueueServiceImpl::RemoveQueueItem(grpc::ServerContext* context,
                                               const v1::RemoveQueueItemRequest* request,
                                               v1::RemoveQueueItemResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(queue_.remove(request->number(), caller_of(*context)));
}

grpc::Status QueueServiceImpl::RunQueueItem(grpc::ServerContext* context,
                                            const v1::RunQueueItemRequest* request,
                                            v1::RunQueueItemResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(queue_.run_now(request->number(), caller_of(*context)), response);
}

grpc::Status QueueServiceImpl::ApproveQueueItem(grpc::ServerContext* context,
                                                const v1::ApproveQueueItemRequest* request,
                                                v1::ApproveQueueItemResponse* response) {
  GW_CHECK_LIMITS(*request);
  return answer(queue_.approve(request->number(), caller_of(*context)), response);
}

grpc::Status QueueServiceImpl::SetQueue(grpc::ServerContext* context, const v1::SetQueueRequest* request,
                                        v1::SetQueueResponse* response) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<v1::QueueState> state = queue_.set(*request, caller_of(*context));
  if (!state.ok()) return to_grpc(state.status());
  *response->mutable_queue() = *state;
  return grpc::Status::OK;
}

grpc::Status QueueServiceImpl::HoldQueue(grpc::ServerContext* context, const v1::HoldQueueRequest* request,
                                         v1::HoldQueueResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<v1::QueueHold> hold = queue_.hold(*request, caller_of(*context));
  if (!hold.ok()) return to_grpc(hold.status());
  *response->mutable_hold() = *std::move(hold);
  return grpc::Status::OK;
}

grpc::Status QueueServiceImpl::ReleaseQueue(grpc::ServerContext* context,
                                            const v1::ReleaseQueueRequest* request,
                                            v1::ReleaseQueueResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(queue_.release(request->number(), caller_of(*context)));
}

grpc::Status QueueServiceImpl::ListQueueHistory(grpc::ServerContext*,
                                                const v1::ListQueueHistoryRequest* request,
                                                v1::ListQueueHistoryResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<Page> page = Page::of(*request);
  if (!page.ok()) return to_grpc(page.status());
  absl::StatusOr<std::vector<v1::QueueEvent>> events = queue_.history(request->item());
  if (!events.ok()) return to_grpc(events.status());
  for (v1::QueueEvent& event : *events) *response->add_events() = std::move(event);
  page->cut(*response->mutable_events());
  response->set_next_page_token(page->next_token());
  return grpc::Status::OK;
}

grpc::Status QueueServiceImpl::FetchComposite(grpc::ServerContext*, const v1::FetchCompositeRequest* request,
                                              grpc::ServerWriter<v1::FetchCompositeResponse>* writer) {
  GW_CHECK_LIMITS(*request);
  const absl::StatusOr<PositionedFile> file = queue_.composite(request->session());
  if (!file.ok()) return to_grpc(file.status());
  const absl::StatusOr<std::uint64_t> size = file->size_bytes();
  if (!size.ok()) return to_grpc(size.status());
  v1::FetchCompositeResponse response;
  for (std::uint64_t at = 0; at < *size; at += kChunkBytes) {
    std::string& chunk = *response.mutable_chunk();
    chunk.resize(std::min<std::uint64_t>(kChunkBytes, *size - at));
    if (const absl::Status read = file->read_at(at, chunk); !read.ok()) return to_grpc(read);
    if (!writer->Write(response)) break;
  }
  return grpc::Status::OK;
}

}  // namespace glasswing
