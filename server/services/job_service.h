// JobService: the order in which solvers work.
#pragma once

#include "glasswing/v1/job_service.grpc.pb.h"
#include "server/services/server.h"

namespace glasswing {

class JobServiceImpl final : public v1::JobService::Service {
 public:
  explicit JobServiceImpl(Server& server) : server_(server) {}
  grpc::Status SetJobPriority(grpc::ServerContext*, const v1::SetJobPriorityRequest*,
                              v1::SetJobPriorityResponse*) override;
  grpc::Status SetJobDeadline(grpc::ServerContext*, const v1::SetJobDeadlineRequest*,
                              v1::SetJobDeadlineResponse*) override;

 private:
  Server& server_;
};

}  // namespace glasswing
