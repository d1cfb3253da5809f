// The server's solves: sessions cut into tiles for the solvers, from the asking to the matte that can be
// fetched.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/base/time.h"
#include "core/pattern/method_options.h"
#include "core/pattern/video_frames.h"
#include "server/server.h"
#include "server/session_archive.h"
#include "server/session_facts.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// About a second of work each, and enough of them for several solvers.
constexpr int kPixelsPerTile = 1024;
constexpr int kMostFramesPerTile = 16, kFewestFramesPerTile = 4;

std::vector<int> row_tiles(const v1::Camera& camera) {
  const int rows =
      std::clamp(kPixelsPerTile / std::max(camera.width_px(), 1), 1, std::max(camera.height_px(), 1));
  std::vector<int> tiles;
  for (int left = camera.height_px(); left > 0; left -= rows) tiles.push_back(std::min(rows, left));
  return tiles;
}

// The last ones are smaller, so that all solvers end together.
std::vector<int> frame_tiles(int frames) {
  std::vector<int> tiles;
  for (int left = frames; left > 0; left -= tiles.back())
    tiles.push_back(std::min(left, std::clamp(left / 2, kFewestFramesPerTile, kMostFramesPerTile)));
  return tiles;
}

absl::Status check_solvable(const v1::Session& session) {
  const bool captured = session.state() == v1::SESSION_STATE_CAPTURED ||
                        session.state() == v1::SESSION_STATE_DONE || rests_in_solve(session);
  return captured ? absl::OkStatus() : not_now(session, "solved (it must be captured first)");
}

absl::StatusOr<std::vector<int>> tiles_for(const v1::Session& session, const std::string& method,
                                           const v1::CaptureManifest& manifest) {
  if (method != kRampMethod) return row_tiles(manifest.camera());
  std::vector<int> tiles = frame_tiles(static_cast<int>(video_frames(manifest).size()));
  if (!tiles.empty()) return tiles;
  return absl::FailedPreconditionError(fmt::format(
      "session \"{}\" has no frame of the ramp with the object; method \"{}\" makes mattes of such",
      session.name(), method));
}

std::vector<FrameRange> runs_of(const google::protobuf::RepeatedField<std::int32_t>& rising) {
  std::vector<FrameRange> runs;
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
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, SessionArchive(session).manifest());
  GW_ASSIGN_OR_RETURN(const std::vector<int> tiles, tiles_for(session, method, manifest));

  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(session, find_locked(request.name()));
  GW_RETURN_IF_ERROR(check_stays(session.name()));
  GW_RETURN_IF_ERROR(check_solvable(session));
  if (session.state() == v1::SESSION_STATE_DONE) GW_RETURN_IF_ERROR(catalogue_->keep_finished(session));
  GW_RETURN_IF_ERROR(jobs_->create(session.name(), tiles));
  session.set_method(method);
  *session.mutable_options() = request.options();
  note_video(manifest, session);
  if (!session.matte_ready()) session.clear_solved_frames();
  session.clear_refused_frames();
  session.clear_refusal();
  session.set_tile_count(static_cast<int>(tiles.size()));
  session.set_tiles_done(0);
  session.set_object_pixel_count(0);
  session.set_flagged_pixel_count(0);
  session.set_solve_seconds(0.0);
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_reason();
  start_solve_clock(session);
  mattes_.drop_next(session.name());
  GW_RETURN_IF_ERROR(change(session));
  spdlog::info("solving session={} method={} tiles={}", session.name(), method, session.tile_count());
  return session;
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
  GW_RETURN_IF_ERROR(jobs_->hold(session.name()));
  spdlog::info("paused session={} tiles={} of={}", session.name(), session.tiles_done(),
               session.tile_count());
  return session;
}

absl::StatusOr<v1::Session> Server::resume_solve(v1::Session session) {
  const std::string name = session.name();
  GW_RETURN_IF_ERROR(jobs_->retry(name));
  if (session.state() == v1::SESSION_STATE_FAILED) {
    // Frames that were refused become tiles of their own, so that none of the others is solved again.
    GW_RETURN_IF_ERROR(jobs_->add(name, runs_of(session.refused_frames())));
    session.clear_refused_frames();
    session.clear_refusal();
  }
  GW_ASSIGN_OR_RETURN(const std::vector<Tile> tiles, jobs_->tiles(name));
  session.set_tile_count(static_cast<int>(tiles.size()));
  session.set_tiles_done(static_cast<int>(std::ranges::count_if(tiles, &Tile::is_done)));
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_reason();
  start_solve_clock(session);
  GW_RETURN_IF_ERROR(change(session));
  GW_RETURN_IF_ERROR(jobs_->release(name));
  spdlog::info("solving on session={} tiles={} of={}", name, session.tiles_done(), session.tile_count());
  if (session.tiles_done() == session.tile_count()) GW_RETURN_IF_ERROR(finish_solve(session));
  return find_locked(name);
}

absl::StatusOr<v1::Session> Server::cancel_solve(v1::Session session) {
  // Tiles given up say that this was begun, should it break off. What was made goes before the session is
  // done again: what is there then counts as finished.
  GW_RETURN_IF_ERROR(jobs_->give_up(session.name()));
  mattes_.drop_next(session.name());
  if (session.matte_ready()) {
    GW_ASSIGN_OR_RETURN(session, catalogue_->finished(session.name()));
  } else {
    // Its frames are all there: only the solve is given up.
    session.set_state(v1::SESSION_STATE_CAPTURED);
    session.set_reason("the solve was cancelled");
    session.set_tile_count(0);
    session.set_tiles_done(0);
    session.clear_solved_frames();
    session.clear_refused_frames();
    session.clear_refusal();
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
