#include "server/archives/session_deleter.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/file/fault_point.h"
#include "server/archives/replicas.h"
#include "server/archives/session_archive.h"
#include "server/sessions/session_state.h"

namespace glasswing {

absl::StatusOr<std::int64_t> SessionDeleter::remove(const std::string& name) {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> each, sessions_.edit().find_each_anywhere(name));
  for (const v1::Session& one : each) GW_RETURN_IF_ERROR(check_allows(one, v1::SESSION_ACTION_DELETE));
  std::int64_t freed_bytes = 0;
  for (const v1::Session& one : each) {
    GW_ASSIGN_OR_RETURN(const std::int64_t bytes, remove_one(one.name()));
    freed_bytes += bytes;
  }
  return freed_bytes;
}

absl::StatusOr<std::int64_t> SessionDeleter::remove_one(const std::string& name) {
  v1::Session session;
  {
    SessionStore::Edit edit = sessions_.edit();
    GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> found, edit.find_each_anywhere(name));
    session = found.front();
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

absl::StatusOr<std::int64_t> SessionDeleter::remove_archives(const v1::Session& session) {
  GW_RETURN_IF_ERROR(check_archives_answer(session));
  GW_ASSIGN_OR_RETURN(const std::int64_t replica_bytes, remove_replicas(session));
  GW_ASSIGN_OR_RETURN(const std::int64_t bytes, SessionArchive(session).remove());
  return bytes + replica_bytes;
}

absl::StatusOr<std::int64_t> SessionDeleter::remove_all_of(v1::Session session) {
  const std::string& name = session.name();
  std::int64_t freed_bytes = 0;
  if (!session.archive_address().empty()) {
    GW_ASSIGN_OR_RETURN(freed_bytes, remove_archives(session));
    // If the rest fails, the session must not appear to have frames.
    session.set_state(v1::SESSION_STATE_CANCELLED);
    session.set_reason(fmt::format("its frames were deleted; finish with: glasswing delete {} --now", name));
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

absl::StatusOr<std::string> SessionDeleter::put_into_trash(const std::string& name) {
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> each, edit.find_each(name));
  for (const v1::Session& one : each) {
    GW_RETURN_IF_ERROR(check_allows(one, v1::SESSION_ACTION_DELETE));
    GW_RETURN_IF_ERROR(edit.check_unused(one.name()));
  }
  const std::string since = utc_now_rfc3339();
  for (v1::Session session : each) {
    if (rests_in_solve(session)) {
      GW_ASSIGN_OR_RETURN(session, others_.give_up_solve(edit, session));
    }
    session.set_deleted(since);
    GW_RETURN_IF_ERROR(edit.change(session));
    spdlog::info("put into the trash session={}", session.name());
  }
  return since;
}

absl::Status SessionDeleter::mark_frames(const std::string& name) {
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(v1::Session session, edit.find(name));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_DELETE));
  session.set_frames_deleted(utc_now_rfc3339());
  return edit.change(session);
}

absl::Status SessionDeleter::undelete(const std::string& name) {
  SessionStore::Edit edit = sessions_.edit();
  GW_ASSIGN_OR_RETURN(std::vector<v1::Session> each, edit.find_each_anywhere(name));
  std::erase_if(each,
                [](const v1::Session& one) { return one.deleted().empty() && one.frames_deleted().empty(); });
  if (each.empty()) {
    return absl::NotFoundError(
        fmt::format("session \"{}\" is not in the trash; `glasswing du` says what is", name));
  }
  for (const v1::Session& one : each) {
    GW_RETURN_IF_ERROR(edit.check_stays(one.name()));
    if (!one.deleted().empty() && one.state() == v1::SESSION_STATE_CANCELLED && one.archive_bytes() == 0 &&
        one.proven_count() > 0) {
      return absl::FailedPreconditionError(
          fmt::format("the frames of session \"{}\" are removed already", one.name()));
    }
  }
  for (v1::Session& session : each) {
    session.clear_deleted();
    session.clear_frames_deleted();
    session.set_kept(true);
    GW_RETURN_IF_ERROR(edit.change(session));
    spdlog::info("undeleted session={}", session.name());
  }
  return absl::OkStatus();
}

absl::Status SessionDeleter::remove_frames(const std::string& name) {
  v1::Session session;
  {
    SessionStore::Edit edit = sessions_.edit();
    GW_ASSIGN_OR_RETURN(session, edit.find(name));
    GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_DELETE));
    absl::Time marked = absl::InfinitePast();
    (void)absl::ParseTime(absl::RFC3339_full, session.frames_deleted(), &marked, nullptr);
    if (session.state() != v1::SESSION_STATE_DONE || mattes_.finished_at(name) > marked + absl::Seconds(1)) {
      session.clear_frames_deleted();
      return edit.change(session);
    }
    GW_RETURN_IF_ERROR(edit.begin_deleting(name));
  }
  const absl::StatusOr<std::int64_t> freed_bytes = remove_archives(session);
  SessionStore::Edit edit = sessions_.edit();
  edit.end_deleting(name);
  GW_RETURN_IF_ERROR(freed_bytes.status());
  session.clear_frames_deleted();
  session.set_frames_gone(utc_now_rfc3339());
  session.clear_archive_address();
  session.set_archive_bytes(0);
  GW_RETURN_IF_ERROR(edit.change(session));
  spdlog::info("frames removed session={} bytes={}", name, *freed_bytes);
  return absl::OkStatus();
}

}  // namespace glasswing
