#include "server/services/job_service.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

absl::StatusOr<JobClass> class_of(v1::JobPriority priority) {
  switch (priority) {
    case v1::JOB_PRIORITY_BATCH:
      return JobClass::kBatch;
    case v1::JOB_PRIORITY_NORMAL:
      return JobClass::kNormal;
    case v1::JOB_PRIORITY_INTERACTIVE:
      return JobClass::kInteractive;
    default:
      return absl::InvalidArgumentError("priority must be batch, normal or interactive");
  }
}

absl::Status set_priority(Server& server, const v1::SetJobPriorityRequest& request) {
  GW_ASSIGN_OR_RETURN(const JobClass priority, class_of(request.priority()));
  GW_ASSIGN_OR_RETURN(const v1::Session session, server.sessions().find(request.session()));
  const bool is_solved = session.state() == v1::SESSION_STATE_SOLVING || rests_in_solve(session);
  const absl::Status not_solved = absl::FailedPreconditionError(
      fmt::format("session \"{}\" is {}; only one that is being solved has a priority", session.name(),
                  state_of(session)));
  if (!is_solved) return not_solved;
  const absl::Status set = server.jobs().set_class(session.job(), priority);
  return absl::IsNotFound(set) ? not_solved : set;  // it has ended meanwhile
}

}  // namespace

grpc::Status JobServiceImpl::SetJobPriority(grpc::ServerContext*, const v1::SetJobPriorityRequest* request,
                                            v1::SetJobPriorityResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(set_priority(server_, *request));
}

}  // namespace glasswing
