// The ends of the server's solves: tiles put together to the matte that can be fetched. That takes seconds,
// so a thread of its own does it, and claims and results go on meanwhile.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "core/base/fault_point.h"
#include "core/base/file.h"
#include "core/base/mapped_file.h"
#include "core/base/status.h"
#include "core/matte/join_mattes.h"
#include "core/matte/matte_file.h"
#include "core/storage/matte_files.h"
#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kLookEvery(2);
constexpr int kMaxBlankRows = 64;  // that are in memory, not packed

// The file of a tile, as it was written.
absl::StatusOr<std::shared_ptr<const MappedFile>> open_tile(const fs::path& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error) return absl::DataLossError(fmt::format("{}: {}", path.string(), error.message()));
  GW_ASSIGN_OR_RETURN(std::shared_ptr<const MappedFile> file, MappedFile::open(path, size));
  if (!is_named_after(path, file->bytes()) || !file->intact())
    return absl::DataLossError(fmt::format("{} is damaged: solve the session again", path.string()));
  return file;
}

// Of those tiles that are done; rows that none holds stay blank, and are flagged.
absl::StatusOr<std::string> put_together(const std::vector<TileState>& tiles, const fs::path& directory,
                                         int height_px) {
  std::vector<std::shared_ptr<const MappedFile>> files;
  std::vector<bool> there(static_cast<size_t>(height_px), false);
  for (const TileState& tile : tiles) {
    if (!tile.is_done()) continue;
    GW_ASSIGN_OR_RETURN(files.emplace_back(), open_tile(directory / tile.done.result));
    std::fill_n(there.begin() + tile.range.first, tile.range.count, true);
  }
  if (files.empty()) return absl::FailedPreconditionError("none of its tiles is solved yet");
  GW_ASSIGN_OR_RETURN(const MatteOutline like, outline_of(files.front()->bytes()));
  std::vector<std::string> blanks;
  for (int y = 0, rows = 1; y < height_px; y += rows) {
    const auto next = std::find(there.begin() + y, there.end(), !there[static_cast<size_t>(y)]);
    rows = static_cast<int>(next - there.begin()) - y;
    if (there[static_cast<size_t>(y)]) continue;
    rows = std::min(rows, kMaxBlankRows);
    Matte blank(0, y, like.width_px, rows, like.modes_per_channel, like.colourless);
    blank.metadata = like.metadata;
    for (int row = 0; row < rows; ++row) {
      for (int x = 0; x < blank.width_px(); ++x) blank.flags(x, row) = kFlagNoData;
    }
    GW_ASSIGN_OR_RETURN(blanks.emplace_back(), encode_matte(blank));
  }
  std::vector<std::string_view> parts(blanks.begin(), blanks.end());
  for (const std::shared_ptr<const MappedFile>& file : files) parts.push_back(file->bytes());
  absl::StatusOr<std::string> whole = join_mattes(parts);
  for (const std::shared_ptr<const MappedFile>& file : files) {
    if (!file->intact()) return absl::DataLossError("a tile's file cannot be read to its end");
  }
  return whole;
}

int height_of(const std::vector<TileState>& tiles) {
  int height_px = 0;
  for (const TileState& tile : tiles) height_px = std::max(height_px, tile.range.first + tile.range.count);
  return height_px;
}

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

}  // namespace

void Server::finish_solves(std::stop_token stop) {
  while (!stop.stop_requested()) {
    std::set<std::string> names;
    {
      std::unique_lock lock(mutex_);
      finish_wanted_.wait_for(lock, stop, kLookEvery, [&] { return !to_finish_.empty(); });
      names = std::exchange(to_finish_, {});
      // Nobody tells of a last tile that the job store gave up, nor comes back to one that could not be
      // counted.
      for (const auto& [name, began] : solve_began_) names.insert(name);
    }
    for (const std::string& name : names) {
      const absl::Status status = finish_solve(name);
      if (!status.ok() && !absl::IsUnavailable(status))  // the job store is away, and comes back
        spdlog::error("solve not finished session={} error=\"{}\"", name, std::string(status.message()));
    }
  }
}

void Server::look_whether_finished(const std::string& name) {
  to_finish_.insert(name);
  finish_wanted_.notify_all();
}

absl::Status Server::finish_solve(const std::string& name) {
  v1::Session session;
  {
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<v1::Session> found = find_locked(name);
    if (!found.ok() || found->state() != v1::SESSION_STATE_SOLVING) return absl::OkStatus();
    session = *found;
  }
  GW_ASSIGN_OR_RETURN(const JobCounts counts, jobs_->counts(session.job()));
  if (!counts.rests()) return absl::OkStatus();
  absl::Status made;
  if (counts.quarantined > 0) {
    GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, jobs_->tiles(session.job()));
    name_quarantined(tiles, session);
    made = not_solved(session);
  } else if (!is_solved_by_frames(session)) {
    made = [&]() -> absl::Status {
      GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, jobs_->tiles(session.job()));
      GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(name));
      GW_ASSIGN_OR_RETURN(const std::string bytes, put_together(tiles, directory, height_of(tiles)));
      return write_file_durably(mattes_.next(name), bytes);
    }();
    fault_point("matte written");
  } else if (!session.refused_frames().empty()) {
    made = absl::FailedPreconditionError(fmt::format("no matte can be made of {} of its frames; {}",
                                                     session.refused_frames_size(), session.refusal()));
  }
  if (absl::IsUnavailable(made)) return made;
  const std::lock_guard lock(mutex_);
  const absl::StatusOr<v1::Session> now = find_locked(name);
  if (now.ok() && absl::IsResourceExhausted(made)) {
    wait_for_room(*now, made);
    return absl::OkStatus();  // looked at again soon
  }
  // It may have been paused, cancelled or deleted meanwhile.
  if (!now.ok() || now->job() != session.job() || now->state() != v1::SESSION_STATE_SOLVING) {
    return absl::IsNotFound(now.status()) ? mattes_.drop_next(name) : absl::OkStatus();
  }
  v1::Session settled = *now;
  *settled.mutable_quarantined() = session.quarantined();
  count_tiles(counts, settled);
  return settle(std::move(settled), made);
}

void Server::wait_for_room(v1::Session session, const absl::Status& full) {
  if (session.state() != v1::SESSION_STATE_SOLVING) return;
  const std::string reason =
      fmt::format("waiting for room on the server's disk: {}", std::string(full.message()));
  if (!session.reason().starts_with("waiting")) spdlog::warn("{} session={}", reason, session.name());
  session.set_reason(reason);
  live_[session.name()] = session;
  announce();
}

absl::Status Server::settle(v1::Session session, absl::Status made) {
  if (made.ok() && has_frame_files(session)) {
    GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, jobs_->tiles(session.job()));
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
    GW_RETURN_IF_ERROR(jobs_->suspend(session.job()));
  }
  GW_RETURN_IF_ERROR(change(session));
  solve_began_.erase(session.name());
  if (made.ok()) {
    fault_point("session done");
    GW_RETURN_IF_ERROR(catalogue_->drop_finished(session.name()));
    GW_RETURN_IF_ERROR(mattes_.finish(session.name()));
  }
  spdlog::info("{} session={} seconds={:.1f} flagged={}", state_of(session), session.name(),
               session.solve_seconds(), session.flagged_pixel_count());
  return absl::OkStatus();
}

absl::StatusOr<std::string> Server::partial_matte(const std::string& name) {
  v1::Session session;
  {
    const std::lock_guard lock(mutex_);
    GW_ASSIGN_OR_RETURN(session, find_locked(name));
  }
  if (is_solved_by_frames(session)) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" is a video: what is solved of it can be fetched into a directory as it is", name));
  }
  if (session.state() != v1::SESSION_STATE_SOLVING && !rests_in_solve(session)) {
    GW_ASSIGN_OR_RETURN(const fs::path path, matte(name, std::nullopt));
    return read_file(path);
  }
  GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, jobs_->tiles(session.job()));
  GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(name));
  absl::StatusOr<std::string> matte = put_together(tiles, directory, height_of(tiles));
  if (!absl::IsFailedPrecondition(matte.status())) return matte;
  return absl::FailedPreconditionError(
      fmt::format("session \"{}\": {}", name, std::string(matte.status().message())));
}

}  // namespace glasswing
