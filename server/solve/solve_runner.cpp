// The server's solves: sessions cut into tiles for the solvers, from the asking to the matte that can be
// fetched.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/fault_point.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/pattern/method_options.h"
#include "core/pattern/video_frames.h"
#include "server/archives/replicas.h"
#include "server/archives/session_archive.h"
#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"
#include "server/solve/tile_sizes.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Of frames' samples, that a solver holds of one tile, and of the tile's own pixels.
constexpr std::int64_t kMaxTileBytes = 256 << 20, kMaxTilePixels = 400'000;

// From the node that captured it, else from any with a copy.
absl::StatusOr<v1::CaptureManifest> read_manifest(const v1::Session& session, const NodeRegistry& rig) {
  absl::StatusOr<v1::CaptureManifest> manifest = SessionArchive(session).manifest();
  for (const v1::ArchiveCopy& copy : session.copies()) {
    if (manifest.ok() || !is_whole(copy)) continue;
    const absl::StatusOr<std::string> address = keeper_address(copy.node(), rig);
    if (!address.ok()) continue;
    absl::StatusOr<v1::CaptureManifest> copied =
        SessionArchive(session.name(), copy.node(), *address).manifest();
    if (copied.ok()) manifest = std::move(copied);
  }
  return manifest;
}

absl::Status check_solvable(const v1::Session& session) {
  const bool captured = session.state() == v1::SESSION_STATE_CAPTURED ||
                        session.state() == v1::SESSION_STATE_DONE || rests_in_solve(session);
  return captured ? absl::OkStatus() : not_now(session, "solved (it must be captured first)");
}

// What a solver is told of every tile.
v1::ClaimTileResponse work_of(const v1::Session& session, const v1::CaptureManifest& manifest) {
  v1::ClaimTileResponse work;
  work.set_method(session.method());
  *work.mutable_options() = session.options();
  work.set_archive_address(session.archive_address());
  if (is_solved_by_frames(session)) return work;
  for (const int row : survey_rows(manifest.camera().height_px())) work.add_survey_rows(row);
  return work;
}

// Of a matte of rows, nothing is known of the work yet: its first tile is a survey of the whole.
absl::StatusOr<std::vector<TileRange>> first_tiles(const v1::Session& session,
                                                   const v1::CaptureManifest& manifest) {
  const v1::Camera& camera = manifest.camera();
  if (!is_solved_by_frames(session)) return std::vector{TileRange{.first = 0, .count = camera.height_px()}};
  std::vector<TileRange> tiles =
      frame_tiles(static_cast<int>(video_frames(manifest).size()),
                  static_cast<std::int64_t>(camera.width_px()) * camera.height_px());
  if (!tiles.empty()) return tiles;
  return absl::FailedPreconditionError(fmt::format(
      "session \"{}\" has no frame of the ramp with the object; method \"{}\" makes mattes of such",
      session.name(), session.method()));
}

std::vector<TileRange> runs_of(const google::protobuf::RepeatedField<std::int32_t>& rising) {
  std::vector<TileRange> runs;
  for (const int frame : rising) {
    if (!runs.empty() && frame == runs.back().first + runs.back().count) {
      ++runs.back().count;
    } else {
      runs.push_back({.first = frame, .count = 1});
    }
  }
  return runs;
}

absl::Status check_frame_is_solved(const v1::Session& session, int frame) {
  const std::string& name = session.name();
  if (!has_frame_files(session)) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" has one matte, not one for each frame; fetch it without --frame", name));
  }
  if (frame < 0 || frame >= session.frame_count()) {
    return absl::NotFoundError(fmt::format("the video of session \"{}\" has no frame {}; it has 0 to {}",
                                           name, frame, session.frame_count() - 1));
  }
  if (has_number(session.lost_frames(), frame))
    return absl::NotFoundError(
        fmt::format("frame {} of session \"{}\" was lost: it was not captured", frame, name));
  if (has_number(session.solved_frames(), frame)) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format(
      "frame {} of session \"{}\" is not solved; the session is {}", frame, name, state_of(session)));
}

}  // namespace

absl::StatusOr<v1::Session> Server::solve(const v1::SolveSessionRequest& request) {
  GW_ASSIGN_OR_RETURN(v1::Session session, find(request.name()));
  if (session.plan().has_calibration()) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" measured devices and holds no object; what it found: glasswing calibrate list",
        session.name()));
  }
  const std::string method = request.method().empty() ? session.method() : request.method();
  GW_RETURN_IF_ERROR(check_method(method));
  for (const auto& [option, value] : request.options()) GW_RETURN_IF_ERROR(check_option(method, option));
  GW_RETURN_IF_ERROR(check_solvable(session));
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_manifest(session, rig_));

  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(session, find_locked(request.name()));
  GW_RETURN_IF_ERROR(check_stays(session.name()));
  GW_RETURN_IF_ERROR(check_solvable(session));
  if (session.state() == v1::SESSION_STATE_DONE) GW_RETURN_IF_ERROR(catalogue_->keep_finished(session));
  const std::int64_t job_before = session.job();
  session.set_method(method);
  *session.mutable_options() = request.options();
  note_video(manifest, session);
  GW_ASSIGN_OR_RETURN(const std::vector<TileRange> tiles, first_tiles(session, manifest));
  const v1::ClaimTileResponse work = work_of(session, manifest);
  GW_ASSIGN_OR_RETURN(const std::int64_t job, jobs_->create({.session = session.name(),
                                                             .computes = computes(method),
                                                             .work = work.SerializeAsString()},
                                                            tiles));
  session.set_job(job);
  if (!session.matte_ready()) session.clear_solved_frames();
  session.clear_refused_frames();
  session.clear_refusal();
  session.clear_quarantined();
  // That of a survey tells nothing.
  count_tiles({.tiles = work.survey_rows().empty() ? static_cast<int>(tiles.size()) : 0}, session);
  session.set_solve_seconds(0.0);
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_reason();
  start_solve_clock(session);
  GW_RETURN_IF_ERROR(mattes_.drop_next(session.name()));
  GW_RETURN_IF_ERROR(change(session));
  // Only now: had this ended in between, the session would still be of the old job.
  if (job_before != 0) GW_RETURN_IF_ERROR(jobs_->remove(job_before));
  spdlog::info("solving session={} method={} job={}", session.name(), method, job);
  return session;
}

absl::Status Server::complete_survey(const v1::CompleteSurveyRequest& request) {
  v1::Session session;
  {
    const std::lock_guard lock(mutex_);
    GW_ASSIGN_OR_RETURN(session, session_of(request.lease()));
  }
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_manifest(session, rig_));
  const v1::Camera& camera = manifest.camera();
  v1::ClaimTileResponse work = work_of(session, manifest);
  const std::vector<int> rows(work.survey_rows().begin(), work.survey_rows().end());
  const std::vector<double> seconds(request.row_seconds().begin(), request.row_seconds().end());
  const bool sensible = std::ranges::all_of(seconds, [](double s) { return s >= 0.0 && s < 1e6; });
  if (rows.empty() || seconds.size() != rows.size() || !sensible) {
    return absl::InvalidArgumentError(
        fmt::format("the survey of session \"{}\" must tell the seconds of each of its {} rows",
                    session.name(), rows.size()));
  }
  const std::int64_t row_samples = std::int64_t{camera.width_px()} * manifest.frames_size() * 3;
  const std::int64_t max_bytes = std::min(kMaxTileBytes, kMaxTilePixels * manifest.frames_size() * 6);
  const std::vector<TileRange> tiles =
      row_tiles(camera.height_px(), rows, seconds, row_samples * 2, max_bytes, min_tile_seconds_);
  work.clear_survey_rows();
  GW_RETURN_IF_ERROR(jobs_->recut(attempt_of(request.lease()), work.SerializeAsString(), tiles));
  fault_point("survey committed");
  spdlog::info("surveyed session={} tiles={} solver={}", session.name(), tiles.size(), request.solver());
  note_progress(request.lease());
  return absl::OkStatus();
}

// What it has taken so far counts.
void Server::start_solve_clock(const v1::Session& session) {
  const std::chrono::duration<double> so_far(session.solve_seconds());
  solve_began_[session.name()] = monotonic_now() - std::chrono::duration_cast<nanoseconds>(so_far);
}

absl::StatusOr<v1::Session> Server::pause_solve(v1::Session session) {
  session.set_state(v1::SESSION_STATE_PAUSED);
  session.set_reason("asked to; go on with: glasswing resume " + session.name());
  GW_RETURN_IF_ERROR(change(session));
  GW_RETURN_IF_ERROR(jobs_->suspend(session.job()));
  spdlog::info("paused session={} tiles={} of={}", session.name(), session.tiles_done(),
               session.tile_count());
  return session;
}

absl::StatusOr<v1::Session> Server::resume_solve(v1::Session session) {
  const std::string name = session.name();
  GW_RETURN_IF_ERROR(jobs_->retry(session.job()));
  if (session.state() == v1::SESSION_STATE_FAILED) {
    // Frames that were refused become tiles of their own, so that none of the others is solved again.
    if (!session.refused_frames().empty())
      GW_RETURN_IF_ERROR(jobs_->add(session.job(), runs_of(session.refused_frames())));
    session.clear_refused_frames();
    session.clear_refusal();
    session.clear_quarantined();
  }
  GW_ASSIGN_OR_RETURN(const JobCounts counts, jobs_->counts(session.job()));
  if (session.tile_count() > 0) count_tiles(counts, session);
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_reason();
  start_solve_clock(session);
  GW_RETURN_IF_ERROR(change(session));
  GW_RETURN_IF_ERROR(jobs_->resume(session.job()));
  spdlog::info("solving on session={} tiles={} of={}", name, session.tiles_done(), session.tile_count());
  if (counts.rests()) look_whether_finished(name);
  return session;
}

absl::StatusOr<v1::Session> Server::cancel_solve(v1::Session session, const std::string& reason) {
  // A job that is gone says that this was begun, should it break off. What was made goes before the session
  // is done again: what is there then counts as finished.
  GW_RETURN_IF_ERROR(jobs_->remove(session.job()));
  GW_RETURN_IF_ERROR(mattes_.drop_next(session.name()));
  if (session.matte_ready()) {
    GW_ASSIGN_OR_RETURN(session, catalogue_->finished(session.name()));
  } else {
    // Its frames are all there: only the solve is given up.
    session.set_state(v1::SESSION_STATE_CAPTURED);
    session.set_reason(reason);
    session.clear_job();
    count_tiles({}, session);
    session.clear_solved_frames();
    session.clear_refused_frames();
    session.clear_refusal();
    session.clear_quarantined();
  }
  GW_RETURN_IF_ERROR(change(session));
  GW_RETURN_IF_ERROR(catalogue_->drop_finished(session.name()));
  spdlog::info("solve cancelled session={}", session.name());
  return session;
}

absl::StatusOr<fs::path> Server::matte(const std::string& name, std::optional<int> frame) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(const v1::Session session, find_locked(name));
  // What the session says of its solve is of the last one, which may not have finished.
  v1::Session made = session;
  if (session.matte_ready() && session.state() != v1::SESSION_STATE_DONE) {
    GW_ASSIGN_OR_RETURN(made, catalogue_->finished(name));
  }
  if (frame) {
    GW_RETURN_IF_ERROR(check_frame_is_solved(made, *frame));
    return session.matte_ready() ? mattes_.finished(name, *frame) : mattes_.next(name, *frame);
  }
  if (has_frame_files(made)) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" has a matte for each of {} frames; fetch them into a directory, -o {}/, "
                    "or one with --frame",
                    name, session.frame_count(), name));
  }
  if (!session.matte_ready()) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" is {}; solve it first: glasswing solve {} --watch", name, state_of(session), name));
  }
  return mattes_.finished(name);
}

}  // namespace glasswing
