#include "server/solve/solve_progress.h"

#include "core/base/status.h"
#include "server/sessions/session_state.h"

namespace glasswing {

void SolveProgress::update(const v1::TileLease& lease) {
  std::shared_ptr<SingleFlight> counting;
  {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<SingleFlight>& shared = counting_[lease.session()];
    if (shared == nullptr) shared = std::make_shared<SingleFlight>();
    counting = shared;
  }
  counting->run([&] {
    const absl::Status counted = count(lease);
    if (counted.ok() || absl::IsAborted(counted)) return;  // ABORTED: cancelled just now
    look_later(lease.session());
  });
}

absl::Status SolveProgress::count(const v1::TileLease& lease) {
  GW_ASSIGN_OR_RETURN(const JobCounts counts, stores_.jobs.counts(lease.job()));
  SessionStore::Edit edit = stores_.sessions.edit();
  GW_ASSIGN_OR_RETURN(v1::Session session, session_of(edit, lease));
  if (session.state() != v1::SESSION_STATE_SOLVING && !rests_in_solve(session)) return absl::OkStatus();
  count_tiles(counts, session);
  session.clear_reason();
  if (has_frame_files(session) && !session.matte_ready()) {
    GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, stores_.jobs.tiles(lease.job()));
    note_solved_frames(tiles, session);
  }
  if (const auto seconds = clock_.seconds(session.name())) session.set_solve_seconds(*seconds);
  edit.show(session);  // not written for every tile: the job store can count them again
  if (counts.rests() && session.state() == v1::SESSION_STATE_SOLVING) look_later(session.name());
  return absl::OkStatus();
}

void SolveProgress::forget(const std::string& session) {
  clock_.stop(session);
  const std::lock_guard lock(mutex_);
  counting_.erase(session);
}

}  // namespace glasswing
