// The server's solves: sessions cut into tiles, tiles leased to solvers, and what these hand in made into
// mattes.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/matte/matte_file.h"
#include "core/pattern/video_frames.h"
#include "core/service/service.h"
#include "server/server.h"
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

Tile tile_of(const v1::TileLease& lease) {
  return {.session = lease.session(),
          .number = lease.tile(),
          .first = 0,
          .count = 0,
          .attempt = lease.attempt(),
          .result = ""};
}

absl::StatusOr<fs::path> made_directory(const fs::path& directory) {
  std::error_code error;
  fs::create_directories(directory, error);
  if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot create {}", directory.string()));
  return directory;
}

bool holds(const google::protobuf::RepeatedField<std::int32_t>& rising, int value) {
  return std::binary_search(rising.begin(), rising.end(), value);
}

void note_refused_frames(const v1::CompleteTileRequest& header, v1::Session& session) {
  for (const v1::RefusedFrame& refused : header.refused()) {
    if (holds(session.refused_frames(), refused.frame())) continue;
    session.add_refused_frames(refused.frame());
    std::sort(session.mutable_refused_frames()->begin(), session.mutable_refused_frames()->end());
    // That of the first one tells most: what follows it often fails alike.
    if (session.refused_frames(0) == refused.frame()) session.set_refusal(refused.error());
  }
}

void note_solved_frames(const std::vector<Tile>& tiles, v1::Session& session) {
  session.clear_solved_frames();
  for (const Tile& tile : tiles) {
    for (int frame = tile.first; tile.is_done() && frame < tile.first + tile.count; ++frame) {
      if (!holds(session.lost_frames(), frame) && !holds(session.refused_frames(), frame))
        session.add_solved_frames(frame);
    }
  }
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
  const bool captured = session.state() == v1::SESSION_STATE_CAPTURED ||
                        session.state() == v1::SESSION_STATE_DONE ||
                        (session.state() == v1::SESSION_STATE_FAILED && session.tile_count() > 0);
  if (!captured) return not_now(session, "solved (it must be captured first)");
  v1::GetManifestRequest get;
  get.set_session(session.name());
  v1::GetManifestResponse manifest;
  grpc::ClientContext context;
  set_deadline(context, std::chrono::seconds(30));
  GW_RETURN_IF_ERROR(from_grpc(
      v1::ArchiveService::NewStub(dial(session.archive_address()))->GetManifest(&context, get, &manifest),
      "camera node at " + session.archive_address()));
  std::vector<int> tiles = row_tiles(manifest.manifest().camera());
  if (method == kRampMethod) {
    tiles = frame_tiles(static_cast<int>(video_frames(manifest.manifest()).size()));
    if (tiles.empty()) {
      return absl::FailedPreconditionError(fmt::format(
          "session \"{}\" has no frame of the ramp with the object; method \"{}\" makes mattes of such",
          session.name(), method));
    }
  }

  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(jobs_->create(session.name(), tiles));
  session.set_method(method);
  *session.mutable_options() = request.options();
  note_video(manifest.manifest(), session);
  session.clear_solved_frames();
  session.clear_refused_frames();
  session.clear_refusal();
  session.set_tile_count(static_cast<int>(tiles.size()));
  session.set_tiles_done(0);
  session.set_object_pixel_count(0);
  session.set_flagged_pixel_count(0);
  session.set_solve_seconds(0.0);
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_reason();
  solve_began_[session.name()] = monotonic_now();
  GW_RETURN_IF_ERROR(change(session));
  std::error_code ignored;
  fs::remove_all(data_ / "tiles" / session.name(), ignored);
  fs::remove_all(data_ / "mattes" / session.name(), ignored);
  spdlog::info("solving session={} method={} tiles={}", session.name(), method, session.tile_count());
  return session;
}

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
  GW_ASSIGN_OR_RETURN(const fs::path directory, made_directory(data_ / "tiles" / lease.session()));
  return FrameMattes(directory, tile->first, tile->count);
}

absl::Status Server::complete(const v1::CompleteTileRequest& header, const std::string& matte) {
  const v1::TileLease& lease = header.lease();
  GW_RETURN_IF_ERROR(check_name("session", lease.session()));
  GW_RETURN_IF_ERROR(decode_matte(matte).status());
  GW_ASSIGN_OR_RETURN(const fs::path directory, made_directory(data_ / "tiles" / lease.session()));
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
      if (!mattes.has(frame) && !refused && !holds(session.lost_frames(), frame))
        return absl::InvalidArgumentError(fmt::format("there is no matte of frame {}", frame));
    }
    // A void attempt must not replace what a later one has made.
    GW_RETURN_IF_ERROR(jobs_->keep(tile_of(header.lease()), monotonic_now()));
    if (session.frame_count() > 0)
      GW_RETURN_IF_ERROR(made_directory(data_ / "mattes" / session.name()).status());
    return mattes.place([&](int frame) { return matte_path(session, frame); });
  });
}

absl::Status Server::accept(const v1::CompleteTileRequest& header, const std::string& result,
                            const std::function<absl::Status(const v1::Session&, const Tile&)>& place) {
  const v1::TileLease& lease = header.lease();
  GW_ASSIGN_OR_RETURN(v1::Session session, catalogue_->find(lease.session()));
  GW_ASSIGN_OR_RETURN(std::vector<Tile> tiles, jobs_->tiles(lease.session()));
  const auto known = std::ranges::find(tiles, lease.tile(), &Tile::number);
  const bool again = known != tiles.end() && known->result == result;
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
  if (session.frame_count() > 0 && is_solved_by_frames(session)) note_solved_frames(tiles, session);
  if (const auto began = solve_began_.find(session.name()); began != solve_began_.end()) {
    session.set_solve_seconds(std::chrono::duration<double>(monotonic_now() - began->second).count());
  }
  if (session.tiles_done() == session.tile_count()) return finish_solve(std::move(session));
  return change(session);
}

absl::Status Server::assemble_rows(v1::Session& session) {
  GW_ASSIGN_OR_RETURN(const std::vector<Tile> tiles, jobs_->tiles(session.name()));
  std::vector<Matte> parts;
  ObjectCount pixels;
  for (const Tile& tile : tiles) {
    GW_ASSIGN_OR_RETURN(Matte part, read_matte(data_ / "tiles" / session.name() / tile.result));
    const ObjectCount own = count_object(part);
    pixels.all += own.all;
    pixels.flagged += own.flagged;
    parts.push_back(std::move(part));
  }
  GW_ASSIGN_OR_RETURN(const Matte matte, assemble(parts));
  session.set_object_pixel_count(pixels.all);
  session.set_flagged_pixel_count(pixels.flagged);
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_matte(matte));
  return write_file_durably(data_ / "mattes" / (session.name() + ".exr"), bytes);
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
  } else {
    session.set_state(v1::SESSION_STATE_FAILED);
    session.set_reason(std::string(assembled.message()));
  }
  GW_RETURN_IF_ERROR(change(session));
  std::error_code ignored;
  if (assembled.ok()) fs::remove_all(data_ / "tiles" / session.name(), ignored);
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
  GW_RETURN_IF_ERROR(jobs_->give_up(lease.session()));
  session.set_state(v1::SESSION_STATE_FAILED);
  session.set_reason(request.error());
  spdlog::error("solve failed session={} tile={} reason=\"{}\"", session.name(), lease.tile(),
                request.error());
  return change(session);
}

fs::path Server::matte_path(const v1::Session& session, int frame) const {
  const fs::path mattes = data_ / "mattes";
  return session.frame_count() > 0 ? mattes / session.name() / fmt::format("{:04d}.exr", frame)
                                   : mattes / (session.name() + ".exr");
}

absl::StatusOr<fs::path> Server::matte(const std::string& name, std::optional<int> frame) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, find(name));
  if (frame) return frame_matte(session, *frame);
  if (session.frame_count() > 0 && is_solved_by_frames(session)) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" has a matte for each of {} frames; fetch them into a directory, -o {}/, "
                    "or one with --frame",
                    name, session.frame_count(), name));
  }
  if (session.state() != v1::SESSION_STATE_DONE) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" is {}; solve it first: glasswing solve {} --watch", name, state_of(session), name));
  }
  return data_ / "mattes" / (name + ".exr");
}

absl::StatusOr<fs::path> Server::frame_matte(const v1::Session& session, int frame) const {
  const std::string& name = session.name();
  if (session.frame_count() == 0 || !is_solved_by_frames(session)) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" has one matte, not one for each frame; fetch it without --frame", name));
  }
  if (frame < 0 || frame >= session.frame_count()) {
    return absl::NotFoundError(fmt::format("the video of session \"{}\" has no frame {}; it has 0 to {}",
                                           name, frame, session.frame_count() - 1));
  }
  if (holds(session.lost_frames(), frame))
    return absl::NotFoundError(
        fmt::format("frame {} of session \"{}\" was lost: it was not captured", frame, name));
  if (!holds(session.solved_frames(), frame)) {
    return absl::FailedPreconditionError(fmt::format(
        "frame {} of session \"{}\" is not solved; the session is {}", frame, name, state_of(session)));
  }
  return matte_path(session, frame);
}

}  // namespace glasswing
