// What a session is, from its record and its archive.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/session_service.pb.h"
#include "glasswing/v1/work_service.pb.h"
#include "server/jobs/job_store.h"

namespace glasswing {

// "paused"
std::string state_of(const v1::Session& session);
// FAILED_PRECONDITION: "session "vase" is paused; it cannot be " and `verb`.
absl::Status not_now(const v1::Session& session, const std::string& verb);

// How frames are to be solved where nobody says.
std::string usual_method(const v1::CaptureManifest& manifest);

// Fills in the video's frames, and those that were lost.
void note_video(const v1::CaptureManifest& manifest, v1::Session& session);

// A matte for each frame, rather than one for all.
bool is_solved_by_frames(const v1::Session& session);
// Each in a file of its own: a single frame has one as any still.
bool has_frame_files(const v1::Session& session);

// It is its solve that is paused or failed, not its capture.
bool rests_in_solve(const v1::Session& session);

// How far the solve came.
void count_tiles(const JobCounts& counts, v1::Session& session);

// Which frames of a video have mattes by now.
void note_solved_frames(const std::vector<TileState>& tiles, v1::Session& session);

// What solvers must compute to work on tiles of this method: its version and that of the matte's file.
std::string computes(const std::string& method);
// Names an attempt.
TileAttempt attempt_of(const v1::TileLease& lease);

bool has_number(const google::protobuf::RepeatedField<std::int32_t>& rising, int number);

// How many frames the archive keeps, how they are proven, and their bytes.
void note_frames(const v1::CaptureManifest& manifest, v1::Session& session);

}  // namespace glasswing
