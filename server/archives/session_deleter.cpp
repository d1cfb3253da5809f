#include "server/archives/session_deleter.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "server/archives/replicas.h"
#include "server/archives/session_archive.h"
#include "server/sessions/session_state.h"

namespace glasswing {

absl::StatusOr<std::int64_t> SessionDeleter::remove(const std::string& name) {
  v1::Session session;
  {
    SessionStore::Edit edit = sessions_.edit();
    GW_ASSIGN_OR_RETURN(session, edit.find(name));
    GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_DELETE));
    GW_RETURN_IF_ERROR(edit.begin_deleting(name));
  }
  const absl::StatusOr<std::int64_t> freed_bytes = remove_all_of(session);
  sessions_.edit().end_deleting(name);
  if (freed_bytes.ok()) spdlog::info("deleted session={} bytes={}", name, *freed_bytes);
  return freed_bytes;
}

// Asks every node before any archive is removed.
absl::Status SessionDeleter::check_archives_answer(const v1::Session& session) {
  for (const v1::ArchiveCopy& replica : session.copies()) {
    absl::StatusOr<std::string> address = keeper_address(replica.node(), nodes_);
    const absl::Status answers =
        address.ok() ? SessionArchive(session.name(), replica.node(), *address).check_answers()
                     : address.status();
    if (!answers.ok()) {
      return absl::UnavailableError(fmt::format(
          "node \"{}\" holds a copy of session \"{}\" and cannot remove it; nothing was removed: {}",
          replica.node(), session.name(), std::string(answers.message())));
    }
  }
  return SessionArchive(session).check_answers();
}

absl::StatusOr<std::int64_t> SessionDeleter::remove_replicas(const v1::Session& session) {
  std::int64_t freed_bytes = 0;
  for (const v1::ArchiveCopy& replica : session.copies()) {
    GW_ASSIGN_OR_RETURN(const std::string address, keeper_address(replica.node(), nodes_));
    GW_ASSIGN_OR_RETURN(const std::int64_t bytes,
                        SessionArchive(session.name(), replica.node(), address).remove());
    freed_bytes += bytes;
    GW_RETURN_IF_ERROR(sessions_.drop_replica(session.name(), replica.node()));
  }
  return freed_bytes;
}

absl::StatusOr<std::int64_t> SessionDeleter::remove_all_of(v1::Session session) {
  const std::string& name = session.name();
  std::int64_t freed_bytes = 0;
  if (!session.archive_address().empty()) {
    GW_RETURN_IF_ERROR(check_archives_answer(session));
    GW_ASSIGN_OR_RETURN(const std::int64_t replica_bytes, remove_replicas(session));
    GW_ASSIGN_OR_RETURN(freed_bytes, SessionArchive(session).remove());
    freed_bytes += replica_bytes;
    // If the rest fails, the session must not appear to have frames.
    session.set_state(v1::SESSION_STATE_CANCELLED);
    session.set_reason("its frames were deleted; finish with: glasswing delete " + name);
    session.set_archive_bytes(0);
    session.set_matte_ready(false);
    fault_point("frames deleted");
    GW_RETURN_IF_ERROR(sessions_.edit().change(session));
  }
  GW_ASSIGN_OR_RETURN(const std::int64_t matte_bytes, mattes_.remove(name));
  SessionStore::Edit edit = sessions_.edit();
  GW_RETURN_IF_ERROR(others_.remove_job(session));
  fault_point("mattes deleted");
  GW_RETURN_IF_ERROR(edit.remove(name));
  fault_point("session deleted");
  others_.forget(session);
  return freed_bytes + matte_bytes;
}

}  // namespace glasswing
