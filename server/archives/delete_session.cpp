// The server's removal of sessions. What holds most goes first, and the catalogue's row last: whatever breaks
// off in between, asking again finishes it.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/fault_point.h"
#include "core/base/status.h"
#include "server/archives/replicas.h"
#include "server/archives/session_archive.h"
#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"

namespace glasswing {

absl::StatusOr<std::int64_t> Server::remove(const std::string& name) {
  v1::Session session;
  {
    const std::lock_guard lock(mutex_);
    GW_ASSIGN_OR_RETURN(session, find_locked(name));
    if (session.state() == v1::SESSION_STATE_CAPTURING || session.state() == v1::SESSION_STATE_SOLVING ||
        session.state() == v1::SESSION_STATE_CREATED) {
      return absl::FailedPreconditionError(fmt::format(
          "session \"{}\" is {}; wait for it, or cancel it first: glasswing cancel {}", name,
          session.state() == v1::SESSION_STATE_CREATED ? "being imported" : state_of(session), name));
    }
    GW_RETURN_IF_ERROR(check_stays(name));
    if (replicating_.contains(name)) {
      return absl::FailedPreconditionError(
          fmt::format("session \"{}\" is being replicated; wait for it, or break that off first", name));
    }
    going_.insert(name);
  }
  const absl::StatusOr<std::int64_t> freed_bytes = remove_all_of(session);
  const std::lock_guard lock(mutex_);
  going_.erase(name);
  announce();
  if (freed_bytes.ok()) spdlog::info("deleted session={} bytes={}", name, *freed_bytes);
  return freed_bytes;
}

// All of them, before any is removed.
absl::Status Server::check_archives_answer(const v1::Session& session) {
  for (const v1::ArchiveCopy& copy : session.copies()) {
    absl::StatusOr<std::string> address = keeper_address(copy.node(), rig_);
    const absl::Status answers = address.ok()
                                     ? SessionArchive(session.name(), copy.node(), *address).check_answers()
                                     : address.status();
    if (!answers.ok()) {
      return absl::UnavailableError(fmt::format(
          "node \"{}\" holds a copy of session \"{}\" and cannot remove it; nothing was removed: {}",
          copy.node(), session.name(), std::string(answers.message())));
    }
  }
  return SessionArchive(session).check_answers();
}

absl::StatusOr<std::int64_t> Server::remove_replicas(const v1::Session& session) {
  std::int64_t freed_bytes = 0;
  for (const v1::ArchiveCopy& copy : session.copies()) {
    GW_ASSIGN_OR_RETURN(const std::string address, keeper_address(copy.node(), rig_));
    GW_ASSIGN_OR_RETURN(const std::int64_t bytes,
                        SessionArchive(session.name(), copy.node(), address).remove());
    freed_bytes += bytes;
    GW_RETURN_IF_ERROR(catalogue_->drop_replica(session.name(), copy.node()));
  }
  return freed_bytes;
}

absl::StatusOr<std::int64_t> Server::remove_all_of(v1::Session session) {
  const std::string& name = session.name();
  std::int64_t freed_bytes = 0;
  if (!session.archive_address().empty()) {
    GW_RETURN_IF_ERROR(check_archives_answer(session));
    GW_ASSIGN_OR_RETURN(const std::int64_t copied_bytes, remove_replicas(session));
    GW_ASSIGN_OR_RETURN(freed_bytes, SessionArchive(session).remove());
    freed_bytes += copied_bytes;
    // Should the rest fail, nobody is to take this for a session with frames.
    session.set_state(v1::SESSION_STATE_CANCELLED);
    session.set_reason("its frames were deleted; finish with: glasswing delete " + name);
    session.set_archive_bytes(0);
    session.set_matte_ready(false);
    fault_point("frames deleted");
    const std::lock_guard lock(mutex_);
    GW_RETURN_IF_ERROR(change(session));
  }
  GW_ASSIGN_OR_RETURN(const std::int64_t matte_bytes, mattes_.remove(name));
  const std::lock_guard lock(mutex_);
  if (session.job() != 0) GW_RETURN_IF_ERROR(jobs_->remove(session.job()));
  fault_point("mattes deleted");
  GW_RETURN_IF_ERROR(catalogue_->remove(name));
  fault_point("session deleted");
  solve_began_.erase(name);
  counting_.erase(name);
  operator_asked_.erase(name);
  return freed_bytes + matte_bytes;
}

}  // namespace glasswing
