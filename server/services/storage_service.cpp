#include "server/services/storage_service.h"

#include <absl/time/clock.h>

#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "server/services/pages.h"

namespace glasswing {

grpc::Status StorageServiceImpl::GetUsage(grpc::ServerContext*, const v1::GetUsageRequest* request,
                                          v1::GetUsageResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<Page> page = Page::of(*request);
  if (!page.ok()) return to_grpc(page.status());
  absl::StatusOr<std::vector<v1::SessionUsage>> usage = storage_.usage();
  if (!usage.ok()) return to_grpc(usage.status());
  for (v1::SessionUsage& session : *usage) *response->add_sessions() = std::move(session);
  page->cut(*response->mutable_sessions());
  response->set_next_page_token(page->next_token());
  return grpc::Status::OK;
}

grpc::Status StorageServiceImpl::UndeleteSession(grpc::ServerContext*,
                                                 const v1::UndeleteSessionRequest* request,
                                                 v1::UndeleteSessionResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(storage_.undelete(request->name()));
}

grpc::Status StorageServiceImpl::ApplyRetention(grpc::ServerContext*,
                                                const v1::ApplyRetentionRequest* request,
                                                v1::ApplyRetentionResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<std::vector<v1::SessionEnding>> ended =
      storage_.apply_rules(request->dry_run(), absl::Now());
  if (!ended.ok()) return to_grpc(ended.status());
  for (v1::SessionEnding& ending : *ended) *response->add_endings() = std::move(ending);
  return grpc::Status::OK;
}

}  // namespace glasswing
