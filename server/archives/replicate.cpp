// Copies of a session's archive on other nodes. Pixels go from node to node; the server knows who has them.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <thread>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/service/service.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "server/archives/replicas.h"
#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kLook(100);

using Tell = std::function<bool(const v1::ReplicateSessionResponse&)>;

absl::Status check_complete(const v1::Session& session) {
  const bool captured = session.state() == v1::SESSION_STATE_CAPTURED ||
                        session.state() == v1::SESSION_STATE_SOLVING ||
                        session.state() == v1::SESSION_STATE_DONE || rests_in_solve(session);
  return captured ? absl::OkStatus() : not_now(session, "replicated (it must be captured first)");
}

// Has the node copy, until it is done or `is_wanted` says no more.
absl::Status copy(const std::string& node, const std::string& address, const v1::CopyArchiveRequest& request,
                  const Tell& tell, const std::function<bool()>& is_wanted) {
  const auto stub = v1::ArchiveService::NewStub(dial(address));
  grpc::ClientContext context;
  set_deadline(context, std::chrono::hours(24));
  const auto reader = stub->CopyArchive(&context, request);
  const std::jthread watching([&](std::stop_token done) {
    while (!done.stop_requested() && is_wanted()) sleep_until_monotonic(monotonic_now() + kLook);
    if (!done.stop_requested()) context.TryCancel();
  });
  for (v1::CopyArchiveResponse progress; reader->Read(&progress);) {
    v1::ReplicateSessionResponse response;
    response.set_frames_done(progress.frames_done());
    response.set_frame_count(progress.frame_count());
    response.set_bytes_done(progress.bytes_done());
    response.set_byte_count(progress.byte_count());
    if (!tell(response)) context.TryCancel();
  }
  const grpc::Status status = reader->Finish();
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
    return absl::FailedPreconditionError(
        fmt::format("node \"{}\" keeps no archives; start it with --archives DIR", node));
  }
  // What it says of the node that it copies from is not to be said of itself.
  if (status.error_message().find("node at ") != std::string::npos) return from_grpc(status);
  return from_grpc(status, fmt::format("node \"{}\" at {}", node, address));
}

}  // namespace

absl::Status Server::replicate(const v1::ReplicateSessionRequest& request, const Tell& tell,
                               const std::function<bool()>& is_wanted) {
  const std::string& name = request.name();
  v1::Session session;
  {
    const std::lock_guard lock(mutex_);
    GW_ASSIGN_OR_RETURN(session, find_locked(name));
    GW_RETURN_IF_ERROR(check_stays(name));
    GW_RETURN_IF_ERROR(check_complete(session));
    replicating_.insert(name);
  }
  const absl::Status status = replicate_to(session, request.node(), tell, is_wanted);
  const std::lock_guard lock(mutex_);
  replicating_.erase(replicating_.find(name));
  announce();
  return status;
}

absl::Status Server::replicate_to(const v1::Session& session, const std::string& node, const Tell& tell,
                                  const std::function<bool()>& is_wanted) {
  GW_ASSIGN_OR_RETURN(const std::string address, keeper_address(node, rig_));
  if (address == session.archive_address()) {
    return absl::FailedPreconditionError(
        fmt::format("node \"{}\" captured session \"{}\" and holds its frames", node, session.name()));
  }
  v1::ArchiveCopy copied;
  copied.set_node(node);
  const auto known = std::ranges::find(session.copies(), node, &v1::ArchiveCopy::node);
  const bool listed = known != session.copies().end();
  // From now on there may be a part of it, which goes when the session does.
  if (!listed) GW_RETURN_IF_ERROR(catalogue_->set_replica(session.name(), copied));
  v1::CopyArchiveRequest request;
  request.set_session(session.name());
  request.set_from_address(session.archive_address());
  absl::Status status = copy(node, address, request, tell, is_wanted);
  for (const std::string& other : replica_addresses(session, rig_)) {
    if (!absl::IsUnavailable(status) && !absl::IsDataLoss(status)) break;
    if (other == address) continue;
    request.set_from_address(other);
    const absl::Status again = copy(node, address, request, tell, is_wanted);
    if (again.ok()) status = again;
  }
  if (!listed && (absl::IsFailedPrecondition(status) || absl::IsAlreadyExists(status)))
    GW_RETURN_IF_ERROR(catalogue_->drop_replica(session.name(), node));  // nothing was begun there
  GW_RETURN_IF_ERROR(status);
  copied.set_address(address);
  GW_RETURN_IF_ERROR(catalogue_->set_replica(session.name(), copied));
  spdlog::info("replicated session={} node={}", session.name(), node);
  return absl::OkStatus();
}

}  // namespace glasswing
