#include "server/solve/matte_assembly.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "core/file/file.h"
#include "core/matte/matte_notes.h"
#include "core/matte/packed_matte.h"
#include "server/mattes/join_tiles.h"
#include "server/mattes/sampled_quality.h"
#include "server/mattes/verified_mattes.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kLookEvery(2);

void name_quarantined(const std::vector<TileState>& tiles, v1::Session& session) {
  session.clear_quarantined();
  for (const TileState& tile : tiles) {
    if (!tile.quarantined) continue;
    v1::QuarantinedTile& named = *session.add_quarantined();
    named.set_tile(tile.number);
    named.set_first(tile.range.first);
    named.set_count(tile.range.count);
    named.set_error(tile.error);
  }
}

// "2 of 40 tiles could not be solved", with the first one's error.
absl::Status not_solved(const v1::Session& session) {
  const v1::QuarantinedTile& first = session.quarantined(0);
  const char* unit = is_solved_by_frames(session) ? "frames" : "rows";
  return absl::FailedPreconditionError(fmt::format(
      "{} of {} tiles could not be solved, {} {} to {} first: {}; try them again: glasswing retry {}",
      session.quarantined_size(), session.tile_count(), unit, first.first(),
      first.first() + first.count() - 1, first.error(), session.name()));
}

absl::Status note_warnings_of(const PositionedFile& file, std::vector<std::string>& warnings) {
  GW_ASSIGN_OR_RETURN(const PackedMatteReader matte, PackedMatteReader::open(file));
  note_warnings(matte.outline().metadata, warnings);
  return absl::OkStatus();
}

}  // namespace

MatteAssembly::MatteAssembly(const SolveStores& stores, SolveClock& clock)
    : stores_(stores), clock_(clock), thread_([this](std::stop_token stop) { run(stop); }) {}

void MatteAssembly::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    std::set<std::string> names = to_look_at_.take(stop, kLookEvery);
    // No call announces that the job store quarantined the last tile, or that a tile could not be counted.
    for (std::string& name : clock_.started()) names.insert(std::move(name));
    for (const std::string& name : names) {
      const absl::Status status = finish(name);
      if (absl::IsUnavailable(status)) {  // looked at again soon
        SessionStore::Edit edit = stores_.sessions.edit();
        if (const absl::StatusOr<v1::Session> now = edit.find(name); now.ok())
          wait_for_store(edit, *now, status);
      } else if (!status.ok()) {
        spdlog::error("solve not finished session={} error=\"{}\"", name, std::string(status.message()));
      }
    }
  }
}

absl::Status MatteAssembly::finish(const std::string& name) {
  const absl::StatusOr<v1::Session> found = stores_.sessions.find(name);
  if (!found.ok() || found->state() != v1::SESSION_STATE_SOLVING) return absl::OkStatus();
  v1::Session session = *found;
  GW_ASSIGN_OR_RETURN(const JobCounts counts, stores_.jobs.counts(session.job()));
  if (waits_for_store(session)) answers_again(name);
  if (!counts.rests()) return absl::OkStatus();
  absl::Status made;
  std::vector<std::string> warnings;
  std::optional<MatteQuality> quality;  // not of a video
  if (counts.quarantined > 0) {
    GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, stores_.jobs.tiles(session.job()));
    name_quarantined(tiles, session);
    made = not_solved(session);
  } else {
    made = assemble(session, warnings, quality);
  }
  if (absl::IsUnavailable(made)) return made;
  SessionStore::Edit edit = stores_.sessions.edit();
  const absl::StatusOr<v1::Session> now = edit.find(name);
  if (now.ok() && absl::IsResourceExhausted(made)) {
    wait_for_room(edit, *now, made);
    return absl::OkStatus();  // looked at again soon
  }
  // It may have been paused, cancelled or deleted meanwhile.
  if (!now.ok() || now->job() != session.job() || now->state() != v1::SESSION_STATE_SOLVING) {
    return absl::IsNotFound(now.status()) ? stores_.mattes.drop_next(name) : absl::OkStatus();
  }
  v1::Session settled = *now;
  *settled.mutable_quarantined() = session.quarantined();
  count_tiles(counts, settled);
  if (made.ok()) settled.mutable_matte_warnings()->Assign(warnings.begin(), warnings.end());
  if (made.ok() && quality) GW_RETURN_IF_ERROR(stores_.sessions.keep_quality(name, *quality));
  return settle(edit, std::move(settled), made);
}

void MatteAssembly::answers_again(const std::string& name) {
  SessionStore::Edit edit = stores_.sessions.edit();
  absl::StatusOr<v1::Session> now = edit.find(name);
  if (!now.ok() || !waits_for_store(*now)) return;
  now->clear_reason();
  edit.show(*now);
}

absl::Status MatteAssembly::assemble(const v1::Session& session, std::vector<std::string>& warnings,
                                     std::optional<MatteQuality>& quality) {
  if (!is_solved_by_frames(session)) {
    const auto made = [&]() -> absl::Status {
      GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, stores_.jobs.tiles(session.job()));
      GW_ASSIGN_OR_RETURN(const fs::path directory, stores_.mattes.tiles(session.name()));
      const fs::path unfinished = directory / "joined.tmp";
      const absl::Status joined = [&]() -> absl::Status {
        GW_ASSIGN_OR_RETURN(PositionedFile file, PositionedFile::create(unfinished));
        GW_RETURN_IF_ERROR(join_tiles(tiles, directory, file));
        // As a client will read it. A matte that could be fetched is not replaced by one that cannot.
        GW_RETURN_IF_ERROR(VerifiedMattes().open(unfinished).status());
        GW_RETURN_IF_ERROR(note_warnings_of(file, warnings));
        GW_ASSIGN_OR_RETURN(quality, sampled_quality(file));
        return place_file_durably(unfinished, stores_.mattes.next(session.name()));
      }();
      std::error_code ignored;
      if (!joined.ok()) fs::remove(unfinished, ignored);  // its space may be what others wait for
      return joined;
    }();
    fault_point("matte written");
    return made;
  }
  if (session.refused_frames().empty()) return note_warnings_of_frames(session, warnings);
  return absl::FailedPreconditionError(fmt::format("no matte can be made from {} of its frames; {}",
                                                   session.refused_frames_size(), session.refusal()));
}

absl::Status MatteAssembly::note_warnings_of_frames(v1::Session session,
                                                    std::vector<std::string>& warnings) const {
  GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, stores_.jobs.tiles(session.job()));
  note_solved_frames(tiles, session);
  for (const int frame : session.solved_frames()) {
    const fs::path path = has_frame_files(session) ? stores_.mattes.next(session.name(), frame)
                                                   : stores_.mattes.next(session.name());
    // A damaged one is reported when it is fetched.
    if (const absl::StatusOr<PositionedFile> file = PositionedFile::open(path); file.ok())
      note_warnings_of(*file, warnings).IgnoreError();
  }
  return absl::OkStatus();
}

absl::Status MatteAssembly::settle(SessionStore::Edit& edit, v1::Session session, const absl::Status& made) {
  if (made.ok() && has_frame_files(session)) {
    GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, stores_.jobs.tiles(session.job()));
    note_solved_frames(tiles, session);
  } else if (made.ok()) {
    session.clear_solved_frames();
  }
  if (made.ok()) {
    session.set_state(v1::SESSION_STATE_DONE);
    session.clear_reason();
    session.set_matte_ready(true);
  } else {
    session.set_state(v1::SESSION_STATE_FAILED);
    session.set_reason(std::string(made.message()));
    GW_RETURN_IF_ERROR(stores_.jobs.suspend(session.job()));
  }
  GW_RETURN_IF_ERROR(edit.change(session));
  clock_.stop(session.name());
  if (made.ok()) {
    fault_point("session done");
    GW_RETURN_IF_ERROR(edit.drop_finished(session.name()));
    GW_RETURN_IF_ERROR(stores_.mattes.finish(session.name()));
  }
  spdlog::info("{} session={} seconds={:.1f} flagged={}", state_of(session), session.name(),
               session.solve_seconds(), session.flagged_pixel_count());
  return absl::OkStatus();
}

}  // namespace glasswing
