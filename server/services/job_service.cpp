#include "server/services/job_service.h"

#include <absl/time/clock.h>
#include <absl/time/time.h>
#include <fmt/format.h>

#include <functional>

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

// Calls `change` with the session's job. FAILED_PRECONDITION: it is not being solved; `what`: what it has
// not.
absl::Status change_job(Server& server, const std::string& name, const char* what,
                        const std::function<absl::Status(std::int64_t)>& change) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, server.sessions().find(name));
  const bool is_solved = session.state() == v1::SESSION_STATE_SOLVING || rests_in_solve(session);
  const absl::Status not_solved = absl::FailedPreconditionError(
      fmt::format("session \"{}\" is {}; only one that is being solved has a {}", session.name(),
                  state_of(session), what));
  if (!is_solved) return not_solved;
  const absl::Status changed = change(session.job());
  return absl::IsNotFound(changed) ? not_solved : changed;  // it has ended meanwhile
}

absl::Status set_priority(Server& server, const v1::SetJobPriorityRequest& request) {
  GW_ASSIGN_OR_RETURN(const JobClass priority, class_of(request.priority()));
  return change_job(server, request.session(), "priority",
                    [&](std::int64_t job) { return server.jobs().set_class(job, priority); });
}

absl::Status set_job_deadline(Server& server, const v1::SetJobDeadlineRequest& request) {
  absl::Time deadline = absl::InfiniteFuture();
  const bool is_time = request.deadline().empty() ||
                       absl::ParseTime(absl::RFC3339_full, request.deadline(), &deadline, nullptr);
  if (!is_time || deadline <= absl::Now()) {
    return absl::InvalidArgumentError(
        fmt::format("the deadline is \"{}\"; it must be a time in the future, such as 2026-11-01T20:00:00Z",
                    request.deadline()));
  }
  return change_job(server, request.session(), "deadline",
                    [&](std::int64_t job) { return server.jobs().set_deadline(job, deadline); });
}

}  // namespace

grpc::Status JobServiceImpl::SetJobPriority(grpc::ServerContext*, const v1::SetJobPriorityRequest* request,
                                            v1::SetJobPriorityResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(set_priority(server_, *request));
}

grpc::Status JobServiceImpl::SetJobDeadline(grpc::ServerContext*, const v1::SetJobDeadlineRequest* request,
                                            v1::SetJobDeadlineResponse*) {
  GW_CHECK_LIMITS(*request);
  return to_grpc(set_job_deadline(server_, *request));
}

}  // namespace glasswing
