// A session's record as its solve reads and changes it.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/matte/matte_file.h"
#include "glasswing/v1/work_service.pb.h"
#include "server/jobs/job_store.h"
#include "server/sessions/session_store.h"
#include "server/storage/matte_files.h"

namespace glasswing {

// The stores that every part of a solve uses. Changes to `mattes` are made under a SessionStore::Edit.
struct SolveStores {
  SessionStore& sessions;
  JobStore& jobs;
  const MatteFiles& mattes;
};

// True if each frame gets its own matte; otherwise all frames together make one.
bool is_solved_by_frames(const v1::Session& session);
// True if each of these mattes has its own file. A single frame has one file, like any still.
bool has_frame_files(const v1::Session& session);

// Sets tile and pixel counts.
void count_tiles(const JobCounts& counts, v1::Session& session);

// Sets which frames of a video have mattes by now.
void note_solved_frames(const std::vector<TileState>& tiles, v1::Session& session);

TileAttempt attempt_of(const v1::TileLease& lease);

bool has_number(const google::protobuf::RepeatedField<std::int32_t>& rising, int number);

// INVALID_ARGUMENT: a tile's matte does not have exactly these rows of the session's whole picture.
absl::Status check_rows(const MatteOutline& matte, const TileRange& rows, const v1::Session& session);

// The session that this lease belongs to. ABORTED: it is not being solved, or is now in another job.
absl::StatusOr<v1::Session> session_of(SessionStore::Edit& edit, const v1::TileLease& lease);

// Shows that the solve waits for disk space, or for the job store; the next result that is counted clears it.
void wait_for_room(SessionStore::Edit& edit, v1::Session session, const absl::Status& full);
void wait_for_store(SessionStore::Edit& edit, v1::Session session, const absl::Status& away);
bool waits_for_store(const v1::Session& session);

}  // namespace glasswing
