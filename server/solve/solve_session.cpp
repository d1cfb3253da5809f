#include "server/solve/solve_session.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "server/sessions/session_state.h"

namespace glasswing {

bool is_solved_by_frames(const v1::Session& session) {
  return session.method() == kRampMethod;
}

bool has_frame_files(const v1::Session& session) {
  return session.frame_count() > 0 && is_solved_by_frames(session);
}

void count_tiles(const JobCounts& counts, v1::Session& session) {
  session.set_tile_count(counts.tiles);
  session.set_tiles_done(counts.done);
  session.set_object_pixel_count(counts.object_pixels);
  session.set_flagged_pixel_count(counts.flagged_pixels);
  session.set_unsolved_pixel_count(counts.unsolved_pixels);
}

TileAttempt attempt_of(const v1::TileLease& lease) {
  return {.job = lease.job(), .tile = lease.tile(), .attempt = lease.attempt()};
}

bool has_number(const google::protobuf::RepeatedField<std::int32_t>& rising, int number) {
  return std::binary_search(rising.begin(), rising.end(), number);
}

// A frame that is solved again, in a separate tile, is in two tiles.
void note_solved_frames(const std::vector<TileState>& tiles, v1::Session& session) {
  std::set<int> solved;
  for (const bool done : {true, false}) {
    for (const TileState& tile : tiles) {
      if (tile.is_done() != done) continue;
      for (int frame = tile.range.first; frame < tile.range.first + tile.range.count; ++frame) {
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

absl::Status check_rows(const MatteOutline& matte, const TileRange& rows, const v1::Session& session) {
  if (matte.delivery)
    return absl::InvalidArgumentError(
        fmt::format("the tile of session \"{}\" is packed for delivery, not as a tile", session.name()));
  if (matte.y0_px == rows.first && matte.height_px == rows.count && matte.x0_px == 0 &&
      std::int64_t{matte.width_px} * matte.metadata.height_px() == session.pixel_count())
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the tile of session \"{}\" has {} rows of {} px from row {}; it must have {} rows of the "
                  "whole picture "
                  "from row {}",
                  session.name(), matte.height_px, matte.width_px, matte.y0_px, rows.count, rows.first));
}

absl::StatusOr<v1::Session> session_of(SessionStore::Edit& edit, const v1::TileLease& lease) {
  GW_RETURN_IF_ERROR(check_name("session", lease.session()));
  const absl::StatusOr<v1::Session> session = edit.find(lease.session());
  if (session.ok() && lease.job() != 0 && session->job() == lease.job()) return session;
  if (!session.ok() && !absl::IsNotFound(session.status())) return session.status();
  return absl::AbortedError(
      fmt::format("session \"{}\" is no longer being solved in job {}", lease.session(), lease.job()));
}

namespace {

void wait_for(std::string_view what, SessionStore::Edit& edit, v1::Session session, const absl::Status& why) {
  if (session.state() != v1::SESSION_STATE_SOLVING) return;
  const std::string reason = fmt::format("{}: {}", what, std::string(why.message()));
  if (session.reason() == reason) return;
  if (!session.reason().starts_with(kWaitsForNode)) spdlog::warn("{} session={}", reason, session.name());
  session.set_reason(reason);
  edit.show(session);
}

}  // namespace

void wait_for_room(SessionStore::Edit& edit, v1::Session session, const absl::Status& full) {
  wait_for(kWaitsForServerRoom, edit, std::move(session), full);
}

void wait_for_store(SessionStore::Edit& edit, v1::Session session, const absl::Status& away) {
  wait_for(kWaitsForStore, edit, std::move(session), away);
}

bool waits_for_store(const v1::Session& session) {
  return session.reason().starts_with(kWaitsForStore);
}

}  // namespace glasswing
