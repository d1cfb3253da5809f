#include "server/archives/replicator.h"

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

namespace glasswing {
namespace {

constexpr std::chrono::milliseconds kPoll(100);

// Makes the node copy the archive, until done or `is_wanted` returns false.
absl::Status copy(const std::string& node, const std::string& address, const v1::CopyArchiveRequest& request,
                  const Replicator::Report& report, const std::function<bool()>& is_wanted) {
  const auto stub = v1::ArchiveService::NewStub(dial(address, kArchiveKeepers));
  grpc::ClientContext context;
  set_deadline(context, std::chrono::hours(24));
  const auto reader = stub->CopyArchive(&context, request);
  const std::jthread watching([&](std::stop_token done) {
    while (!done.stop_requested() && is_wanted()) sleep_until_monotonic(monotonic_now() + kPoll);
    if (!done.stop_requested()) context.TryCancel();
  });
  for (v1::CopyArchiveResponse progress; reader->Read(&progress);) {
    v1::ReplicateSessionResponse response;
    response.set_frames_done(progress.frames_done());
    response.set_frame_count(progress.frame_count());
    response.set_bytes_done(progress.bytes_done());
    response.set_byte_count(progress.byte_count());
    if (!report(response)) context.TryCancel();
  }
  const grpc::Status status = reader->Finish();
  if (status.error_code() == grpc::StatusCode::UNIMPLEMENTED) {
    return absl::FailedPreconditionError(
        fmt::format("node \"{}\" does not store archives; start it with --archives DIR", node));
  }
  // An error from the source node already names that node.
  if (status.error_message().find("node at ") != std::string::npos) return from_grpc(status);
  return from_grpc(status, fmt::format("node \"{}\" at {}", node, address));
}

}  // namespace

absl::Status Replicator::replicate(const v1::ReplicateSessionRequest& request, const Report& report,
                                   const std::function<bool()>& is_wanted) {
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> each, sessions_.find_each(request.name()));
  if (each.size() > 1) {
    // The node may be the one that captured a view.
    GW_ASSIGN_OR_RETURN(const std::string address, keeper_address(request.node(), nodes_));
    for (const v1::Session& view : each) GW_RETURN_IF_ERROR(check_allows(view, v1::SESSION_ACTION_REPLICATE));
    std::erase_if(each, [&](const v1::Session& view) { return view.archive_address() == address; });
  }
  v1::ReplicateSessionResponse before;  // of the views that are done
  for (const v1::Session& view : each) {
    v1::ReplicateSessionResponse sum = before;
    const Report add = [&](const v1::ReplicateSessionResponse& own) {
      sum.set_frames_done(before.frames_done() + own.frames_done());
      sum.set_frame_count(before.frame_count() + own.frame_count());
      sum.set_bytes_done(before.bytes_done() + own.bytes_done());
      sum.set_byte_count(before.byte_count() + own.byte_count());
      return report(sum);
    };
    v1::ReplicateSessionRequest own = request;
    own.set_name(view.name());
    GW_RETURN_IF_ERROR(replicate_one(own, add, is_wanted));
    before = sum;
  }
  return absl::OkStatus();
}

absl::Status Replicator::replicate_one(const v1::ReplicateSessionRequest& request, const Report& report,
                                       const std::function<bool()>& is_wanted) {
  const std::string& name = request.name();
  v1::Session session;
  {
    SessionStore::Edit edit = sessions_.edit();
    GW_ASSIGN_OR_RETURN(session, edit.find(name));
    GW_RETURN_IF_ERROR(edit.check_stays(name));
    GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_REPLICATE));
    edit.begin_replicating(name);
  }
  const absl::Status status = replicate_to(session, request.node(), report, is_wanted);
  sessions_.edit().end_replicating(name);
  return status;
}

absl::Status Replicator::replicate_to(const v1::Session& session, const std::string& node,
                                      const Report& report, const std::function<bool()>& is_wanted) {
  GW_ASSIGN_OR_RETURN(const std::string address, keeper_address(node, nodes_));
  if (address == session.archive_address()) {
    return absl::FailedPreconditionError(
        fmt::format("node \"{}\" captured session \"{}\" and already has its frames; name another node", node,
                    session.name()));
  }
  v1::ArchiveCopy replica;
  replica.set_node(node);
  const auto known = std::ranges::find(session.copies(), node, &v1::ArchiveCopy::node);
  const bool listed = known != session.copies().end();
  // From now on the node may have part of the archive, which must be deleted with the session.
  if (!listed) GW_RETURN_IF_ERROR(sessions_.set_replica(session.name(), replica));
  v1::CopyArchiveRequest request;
  request.set_session(session.name());
  request.set_from_address(session.archive_address());
  absl::Status status = copy(node, address, request, report, is_wanted);
  for (const std::string& other : replica_addresses(session, nodes_)) {
    if (!absl::IsUnavailable(status) && !absl::IsDataLoss(status)) break;
    if (other == address) continue;
    request.set_from_address(other);
    const absl::Status again = copy(node, address, request, report, is_wanted);
    if (again.ok()) status = again;
  }
  if (!listed && (absl::IsFailedPrecondition(status) || absl::IsAlreadyExists(status)))
    GW_RETURN_IF_ERROR(sessions_.drop_replica(session.name(), node));  // nothing was begun there
  GW_RETURN_IF_ERROR(status);
  replica.set_address(address);
  GW_RETURN_IF_ERROR(sessions_.set_replica(session.name(), replica));
  spdlog::info("replicated session={} node={}", session.name(), node);
  return absl::OkStatus();
}

}  // namespace glasswing
