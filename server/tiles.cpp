// The server's tiles: leased to solvers, and what these hand in made into mattes.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/matte/matte_file.h"
#include "server/server.h"
#include "server/session_facts.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

Tile tile_of(const v1::TileLease& lease) {
  return {.session = lease.session(),
          .number = lease.tile(),
          .first = 0,
          .count = 0,
          .attempt = lease.attempt(),
          .result = ""};
}

void note_refused_frames(const v1::CompleteTileRequest& header, v1::Session& session) {
  for (const v1::RefusedFrame& refused : header.refused()) {
    if (has_number(session.refused_frames(), refused.frame())) continue;
    session.add_refused_frames(refused.frame());
    std::sort(session.mutable_refused_frames()->begin(), session.mutable_refused_frames()->end());
    // That of the first one tells most: what follows it often fails alike.
    if (session.refused_frames(0) == refused.frame()) session.set_refusal(refused.error());
  }
}

// A frame that is solved once more, in a tile of its own, is in two.
void note_solved_frames(const std::vector<Tile>& tiles, v1::Session& session) {
  std::set<int> solved;
  for (const bool done : {true, false}) {
    for (const Tile& tile : tiles) {
      if (tile.is_done() != done) continue;
      for (int frame = tile.first; frame < tile.first + tile.count; ++frame) {
        if (done) solved.insert(frame);
        if (!done) solved.erase(frame);
      }
    }
  }
  session.clear_solved_frames();
  for (const int frame : solved) {
    if (!has_number(session.lost_frames(), frame) && !has_number(session.refused_frames(), frame))
      session.add_solved_frames(frame);
  }
}

}  // namespace

absl::StatusOr<v1::ClaimTileResponse> Server::claim(const v1::ClaimTileRequest& request) {
  v1::ClaimTileResponse response;
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(const std::optional<Tile> tile, jobs_->claim(request.solver(), monotonic_now()));
  if (!tile) {
    rig_.note(request.solver(), "waiting for work");
    return response;
  }
  GW_ASSIGN_OR_RETURN(const v1::Session session, catalogue_->find(tile->session));
  const bool frames = is_solved_by_frames(session);
  rig_.note(request.solver(), frames ? fmt::format("solving {} frames {} to {}", tile->session, tile->first,
                                                   tile->first + tile->count - 1)
                                     : fmt::format("solving {} tile {}", tile->session, tile->number));
  response.mutable_lease()->set_session(tile->session);
  response.mutable_lease()->set_tile(tile->number);
  response.mutable_lease()->set_attempt(tile->attempt);
  response.set_lease_ms(std::chrono::milliseconds(kLease).count());
  if (frames) {
    response.set_first_frame(tile->first);
    response.set_frame_count(tile->count);
  } else {
    response.set_first_row(tile->first);
    response.set_row_count(tile->count);
  }
  response.set_method(session.method());
  *response.mutable_options() = session.options();
  response.set_archive_address(session.archive_address());
  return response;
}

absl::Status Server::keep(const v1::TileLease& lease) {
  return jobs_->keep(tile_of(lease), monotonic_now());
}

absl::StatusOr<std::optional<FrameMattes>> Server::frames_of(const v1::TileLease& lease) {
  GW_RETURN_IF_ERROR(check_name("session", lease.session()));
  GW_ASSIGN_OR_RETURN(const v1::Session session, catalogue_->find(lease.session()));
  if (!is_solved_by_frames(session)) return std::nullopt;
  GW_ASSIGN_OR_RETURN(const std::vector<Tile> tiles, jobs_->tiles(lease.session()));
  const auto tile = std::ranges::find(tiles, lease.tile(), &Tile::number);
  if (tile == tiles.end())
    return absl::AbortedError(fmt::format("session \"{}\" has no tile {}", lease.session(), lease.tile()));
  GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(lease.session()));
  return FrameMattes(directory, tile->first, tile->count);
}

absl::Status Server::complete(const v1::CompleteTileRequest& header, const std::string& matte) {
  const v1::TileLease& lease = header.lease();
  GW_RETURN_IF_ERROR(check_name("session", lease.session()));
  GW_RETURN_IF_ERROR(decode_matte(matte).status());
  GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(lease.session()));
  const std::string file = fmt::format("{}-{}.exr", lease.tile(), lease.attempt());
  GW_RETURN_IF_ERROR(write_file_durably(directory / file, matte));
  const std::lock_guard lock(mutex_);
  return accept(header, file, [](const v1::Session&, const Tile&) { return absl::OkStatus(); });
}

absl::Status Server::complete(const v1::CompleteTileRequest& header, FrameMattes mattes) {
  GW_RETURN_IF_ERROR(mattes.finish());
  const std::string result = fmt::format("attempt {}", header.lease().attempt());
  const std::lock_guard lock(mutex_);
  return accept(header, result, [&](const v1::Session& session, const Tile& tile) -> absl::Status {
    for (int frame = tile.first; frame < tile.first + tile.count; ++frame) {
      const bool refused = std::ranges::count(header.refused(), frame, &v1::RefusedFrame::frame) > 0;
      if (!mattes.has(frame) && !refused && !has_number(session.lost_frames(), frame))
        return absl::InvalidArgumentError(fmt::format("there is no matte of frame {}", frame));
    }
    // A void attempt must not replace what a later one has made.
    GW_RETURN_IF_ERROR(jobs_->keep(tile_of(header.lease()), monotonic_now()));
    const std::string& name = session.name();
    if (!has_frame_files(session)) return mattes.place([&](int) { return mattes_.next(name); });
    GW_RETURN_IF_ERROR(mattes_.make_next(name));
    return mattes.place([&](int frame) { return mattes_.next(name, frame); });
  });
}

absl::Status Server::accept(const v1::CompleteTileRequest& header, const std::string& result,
                            const std::function<absl::Status(const v1::Session&, const Tile&)>& place) {
  const v1::TileLease& lease = header.lease();
  GW_ASSIGN_OR_RETURN(v1::Session session, catalogue_->find(lease.session()));
  GW_ASSIGN_OR_RETURN(std::vector<Tile> tiles, jobs_->tiles(lease.session()));
  const auto known = std::ranges::find(tiles, lease.tile(), &Tile::number);
  const bool again = known != tiles.end() && known->result == result;
  if (!again && session.state() != v1::SESSION_STATE_SOLVING && !rests_in_solve(session))
    return absl::AbortedError(fmt::format("session \"{}\" is not being solved", session.name()));
  if (known != tiles.end() && !again) GW_RETURN_IF_ERROR(place(session, *known));
  if (known != tiles.end() && !again && header.refused_size() > 0) {
    // Before the tile is done: a crash in between must not make them pass for solved.
    note_refused_frames(header, session);
    GW_RETURN_IF_ERROR(change(session));
  }
  GW_RETURN_IF_ERROR(jobs_->complete(tile_of(lease), result));
  if (again && session.state() != v1::SESSION_STATE_SOLVING) return absl::OkStatus();
  if (!again) {
    known->result = result;
    session.set_object_pixel_count(session.object_pixel_count() + header.object_pixel_count());
    session.set_flagged_pixel_count(session.flagged_pixel_count() + header.flagged_pixel_count());
  }
  // Counted from the store, not added up: a crash between its commit and ours must not lose one.
  session.set_tiles_done(static_cast<int>(std::ranges::count_if(tiles, &Tile::is_done)));
  if (has_frame_files(session) && !session.matte_ready()) note_solved_frames(tiles, session);
  if (const auto began = solve_began_.find(session.name()); began != solve_began_.end()) {
    session.set_solve_seconds(std::chrono::duration<double>(monotonic_now() - began->second).count());
  }
  const bool finished = session.tiles_done() == session.tile_count();
  if (finished && session.state() == v1::SESSION_STATE_SOLVING) return finish_solve(std::move(session));
  return change(session);
}

absl::Status Server::assemble_rows(v1::Session& session) {
  GW_ASSIGN_OR_RETURN(const std::vector<Tile> tiles, jobs_->tiles(session.name()));
  GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(session.name()));
  std::vector<Matte> parts;
  ObjectCount pixels;
  for (const Tile& tile : tiles) {
    GW_ASSIGN_OR_RETURN(Matte part, read_matte(directory / tile.result));
    const ObjectCount own = count_object(part);
    pixels.all += own.all;
    pixels.flagged += own.flagged;
    parts.push_back(std::move(part));
  }
  GW_ASSIGN_OR_RETURN(const Matte matte, assemble(parts));
  session.set_object_pixel_count(pixels.all);
  session.set_flagged_pixel_count(pixels.flagged);
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(matte));
  return write_file_durably(mattes_.next(session.name()), bytes);
}

absl::Status Server::finish_solve(v1::Session session) {
  absl::Status assembled = is_solved_by_frames(session) ? absl::OkStatus() : assemble_rows(session);
  if (!session.refused_frames().empty()) {
    assembled = absl::FailedPreconditionError(fmt::format("no matte can be made of {} of its frames; {}",
                                                          session.refused_frames_size(), session.refusal()));
  }
  if (assembled.ok()) {
    session.set_state(v1::SESSION_STATE_DONE);
    session.clear_reason();
    session.set_matte_ready(true);
    if (has_frame_files(session)) {
      GW_ASSIGN_OR_RETURN(const std::vector<Tile> tiles, jobs_->tiles(session.name()));
      note_solved_frames(tiles, session);
    } else {
      session.clear_solved_frames();
    }
  } else {
    session.set_state(v1::SESSION_STATE_FAILED);
    session.set_reason(std::string(assembled.message()));
    GW_RETURN_IF_ERROR(jobs_->hold(session.name()));
  }
  GW_RETURN_IF_ERROR(change(session));
  if (assembled.ok()) {
    GW_RETURN_IF_ERROR(catalogue_->drop_finished(session.name()));
    GW_RETURN_IF_ERROR(mattes_.finish(session.name()));
  }
  spdlog::info("{} session={} seconds={:.1f} flagged={}", state_of(session), session.name(),
               session.solve_seconds(), session.flagged_pixel_count());
  return absl::OkStatus();
}

absl::Status Server::fail(const v1::FailTileRequest& request) {
  const v1::TileLease& lease = request.lease();
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(const bool exhausted, jobs_->fail(tile_of(lease)));
  if (!exhausted && !request.permanent()) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(v1::Session session, catalogue_->find(lease.session()));
  if (session.state() != v1::SESSION_STATE_SOLVING) return absl::OkStatus();
  // Tiles that others work on may still come, and are kept for a later try.
  GW_RETURN_IF_ERROR(jobs_->hold(lease.session()));
  session.set_state(v1::SESSION_STATE_FAILED);
  session.set_reason(request.error());
  spdlog::error("solve failed session={} tile={} reason=\"{}\"", session.name(), lease.tile(),
                request.error());
  return change(session);
}

}  // namespace glasswing
