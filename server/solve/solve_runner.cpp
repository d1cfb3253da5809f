#include "server/solve/solve_runner.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "core/file/file.h"
#include "core/image/mosaic.h"
#include "core/matte/packed_matte.h"
#include "core/matte/row_part.h"
#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "core/pattern/video_frames.h"
#include "glasswing/v1/tile_work.pb.h"
#include "server/archives/replicas.h"
#include "server/archives/session_archive.h"
#include "server/mattes/join_tiles.h"
#include "server/mattes/sampled_quality.h"
#include "server/sessions/archive_facts.h"
#include "server/sessions/session_state.h"
#include "server/solve/tile_sizes.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Limits of a tile: bytes of frames' samples in a solver's memory, and pixels of the tile itself.
constexpr std::int64_t kMaxTileBytes = 256 << 20, kMaxTilePixels = 400'000;

// From the node that captured the session, or else from any node with a replica.
absl::StatusOr<v1::CaptureManifest> read_manifest(const v1::Session& session, const NodeRegistry& nodes) {
  absl::StatusOr<v1::CaptureManifest> manifest = SessionArchive(session).manifest();
  for (const v1::ArchiveCopy& replica : session.copies()) {
    if (manifest.ok() || !is_whole(replica)) continue;
    const absl::StatusOr<std::string> address = keeper_address(replica.node(), nodes);
    if (!address.ok()) continue;
    absl::StatusOr<v1::CaptureManifest> copied =
        SessionArchive(session.name(), replica.node(), *address).manifest();
    if (copied.ok()) manifest = std::move(copied);
  }
  return manifest;
}

// The work of a solve's first tiles.
v1::TileWork work_of(const v1::Session& session, const v1::CaptureManifest& manifest) {
  v1::TileWork work;
  work.set_method(session.method());
  *work.mutable_options() = session.options();
  work.set_archive_address(session.archive_address());
  if (is_solved_by_frames(session)) return work;
  for (const int row : survey_rows(manifest.camera().height_px())) work.add_survey_rows(row);
  return work;
}

// Nothing is known yet about the cost of a matte's rows: its first tile is a survey of all of them.
absl::StatusOr<std::vector<TileRange>> first_tiles(const v1::Session& session,
                                                   const v1::CaptureManifest& manifest) {
  const v1::Camera& camera = manifest.camera();
  if (!is_solved_by_frames(session)) return std::vector{TileRange{.first = 0, .count = camera.height_px()}};
  std::vector<TileRange> tiles =
      frame_tiles(static_cast<int>(video_frames(manifest).size()),
                  static_cast<std::int64_t>(camera.width_px()) * camera.height_px());
  if (!tiles.empty()) return tiles;
  return absl::FailedPreconditionError(
      fmt::format("session \"{}\" has no frame of the ramp with the object, which method \"{}\" needs",
                  session.name(), session.method()));
}

// The maximum size of a matte file per pixel, packed or not, and of its headers.
constexpr std::int64_t kMaxPixelBytes = 1024, kMaxHeaderBytes = 64 << 20;

// INVALID_ARGUMENT: the file is not the whole matte that the session's solvers would make.
// FAILED_PRECONDITION: it was computed by a different version.
absl::Status check_put(const v1::PutMatteRequest& header, const MatteOutline& outline,
                       const v1::Session& session) {
  const v1::MatteMetadata& made = outline.metadata;
  GW_RETURN_IF_ERROR(check_method(made.method()));
  if (made.method() == kRampMethod)
    return absl::InvalidArgumentError(
        "a matte of method \"ramp\" belongs to a video; it must be from a "
        "still");
  GW_RETURN_IF_ERROR(
      OptionValues::read(made.method(), {made.options().begin(), made.options().end()}).status());
  if (made.session() != session.name() || made.edits_size() > 0 || made.has_draft() ||
      made.sampling_px() > 1) {
    return absl::InvalidArgumentError(fmt::format(
        "the matte is of session \"{}\"{}; it must be the solved one of session \"{}\", unchanged",
        made.session(), made.session() == session.name() ? ", but was edited or is a draft" : "",
        session.name()));
  }
  GW_RETURN_IF_ERROR(check_rows(outline, {.first = 0, .count = made.height_px()}, session));
  if (header.computes() == computes(made.method())) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("the matte was computed by {}; this server expects {}: install the same version everywhere",
                  header.computes(), computes(made.method())));
}

// Also false for a damaged file, which its reader reports.
bool leaves_nothing_out(const PositionedFile& file, const MattePart& part) {
  if (part.region) return false;
  if (part.max_pixels == 0) return true;
  const absl::StatusOr<PackedMatteReader> matte = PackedMatteReader::open(file);
  return matte.ok() &&
         sampling_step(matte->outline().width_px, matte->outline().height_px, part.max_pixels) == 1;
}

void clear_failures(v1::Session& session) {
  session.clear_refused_frames();
  session.clear_refusal();
  session.clear_quarantined();
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

// How to obtain a matte: "solve it first: glasswing solve vase --watch".
std::string way_to_matte(const v1::Session& session) {
  const std::string& name = session.name();
  if (allows(session, v1::SESSION_ACTION_SOLVE))
    return fmt::format("solve it first: glasswing solve {} --watch", name);
  if (session.state() == v1::SESSION_STATE_SOLVING)
    return fmt::format("wait for it: glasswing watch {}; --partial fetches what is solved so far", name);
  if (rests_in_solve(session)) {
    const char* verb = session.state() == v1::SESSION_STATE_PAUSED ? "resume" : "retry";
    return fmt::format("continue it: glasswing {} {}; --partial fetches what is solved so far", verb, name);
  }
  return "only a captured session can be solved";
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
  return absl::FailedPreconditionError(fmt::format("frame {} of session \"{}\" is not solved; {} is {}; {}",
                                                   frame, name, name, state_of(session),
                                                   way_to_matte(session)));
}

}  // namespace

absl::Status SolveRunner::take_up(SessionStore::Edit& edit, std::span<const v1::Session> sessions,
                                  Problems& problems) {
  GW_ASSIGN_OR_RETURN(const std::vector<std::int64_t> jobs, stores_.jobs.own_jobs());
  // A job may be that of a session whose record is damaged.
  const bool all_known = std::ranges::count(sessions, v1::SESSION_STATE_DAMAGED, &v1::Session::state) == 0;
  for (const std::int64_t job : jobs) {
    const bool known = !all_known || std::ranges::count(sessions, job, &v1::Session::job) > 0;
    if (!known) GW_RETURN_IF_ERROR(stores_.jobs.remove(job));
  }
  for (const v1::Session& session : sessions) {
    const absl::Status status = take_up(edit, session);
    if (absl::IsUnavailable(status)) return status;
    if (status.ok()) continue;
    problems.set("session " + session.name(),
                 fmt::format("session \"{}\" could not be resumed when the server started: {}",
                             session.name(), std::string(status.message())));
  }
  return absl::OkStatus();
}

absl::Status SolveRunner::take_up(SessionStore::Edit& edit, const v1::Session& session) {
  if (session.state() != v1::SESSION_STATE_SOLVING && session.job() != 0) {
    const absl::Status suspended = stores_.jobs.suspend(session.job());
    // A finished session no longer needs its tiles, and they may be gone, or in another store.
    if (!suspended.ok() && !absl::IsNotFound(suspended)) return suspended;
  }
  if (session.state() == v1::SESSION_STATE_SOLVING) return take_up_solve(edit, session);
  if (session.state() == v1::SESSION_STATE_DONE) return take_up_matte(edit, session);
  return absl::OkStatus();
}

void SolveRunner::wait_for_store(SessionStore::Edit& edit, std::span<const v1::Session> sessions,
                                 const absl::Status& away) {
  for (const v1::Session& session : sessions) glasswing::wait_for_store(edit, session, away);
}

absl::Status SolveRunner::take_up_solve(SessionStore::Edit& edit, v1::Session session) {
  clock_.start(session);
  // The server may have ended just after the last tile arrived, or while the solve was being cancelled.
  GW_ASSIGN_OR_RETURN(const JobCounts counts, stores_.jobs.counts(session.job()));
  if (counts.tiles == 0) {
    const std::string& name = session.name();
    return cancel(edit, session, fmt::format("its tiles are gone; solve it again: glasswing solve {}", name))
        .status();
  }
  count_tiles(counts, session);
  if (has_frame_files(session) && !session.matte_ready()) {
    GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, stores_.jobs.tiles(session.job()));
    note_solved_frames(tiles, session);
  }
  GW_RETURN_IF_ERROR(edit.change(session));
  GW_RETURN_IF_ERROR(stores_.jobs.resume(session.job()));
  if (counts.rests()) progress_.look_later(session.name());
  return absl::OkStatus();
}

absl::Status SolveRunner::take_up_matte(SessionStore::Edit& edit, v1::Session session) {
  if (!session.matte_ready()) {  // written by a version without the field
    session.set_matte_ready(true);
    GW_RETURN_IF_ERROR(edit.change(session));
  }
  GW_RETURN_IF_ERROR(edit.drop_finished(session.name()));
  return stores_.mattes.finish(session.name());
}

absl::StatusOr<v1::Session> SolveRunner::solve(const v1::SolveSessionRequest& request) {
  GW_ASSIGN_OR_RETURN(v1::Session session, stores_.sessions.find(request.name()));
  if (session.plan().has_calibration()) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" measured devices and has no object; for its results: glasswing calibrate list",
        session.name()));
  }
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_SOLVE));
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_manifest(session, nodes_));
  const std::string method = request.method().empty() ? usual_method(manifest) : request.method();
  GW_RETURN_IF_ERROR(check_method(method));
  GW_RETURN_IF_ERROR(
      OptionValues::read(method, {request.options().begin(), request.options().end()}).status());

  SessionStore::Edit edit = stores_.sessions.edit();
  GW_ASSIGN_OR_RETURN(session, edit.find(request.name()));
  GW_RETURN_IF_ERROR(edit.check_stays(session.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_SOLVE));
  if (session.state() == v1::SESSION_STATE_DONE) GW_RETURN_IF_ERROR(edit.keep_finished(session));
  session.set_method(method);
  *session.mutable_options() = request.options();
  note_video(manifest, session);
  return begin(edit, std::move(session), manifest);
}

absl::StatusOr<v1::Session> SolveRunner::begin(SessionStore::Edit& edit, v1::Session session,
                                               const v1::CaptureManifest& manifest) {
  const std::int64_t job_before = session.job();
  GW_ASSIGN_OR_RETURN(const std::vector<TileRange> tiles, first_tiles(session, manifest));
  const v1::TileWork work = work_of(session, manifest);
  GW_ASSIGN_OR_RETURN(const std::int64_t job, stores_.jobs.create({.session = session.name(),
                                                                   .owner = session.started_by(),
                                                                   .computes = computes(session.method()),
                                                                   .work = work.SerializeAsString()},
                                                                  tiles));
  session.set_job(job);
  if (!session.matte_ready()) session.clear_solved_frames();
  clear_failures(session);
  // A survey's tile count is meaningless.
  count_tiles({.tiles = work.survey_rows().empty() ? static_cast<int>(tiles.size()) : 0}, session);
  session.set_solve_seconds(0.0);
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_reason();
  session.clear_solve_follows();
  clock_.start(session);
  GW_RETURN_IF_ERROR(stores_.mattes.drop_next(session.name()));
  GW_RETURN_IF_ERROR(edit.change(session));
  // Last: if the server ended before this, the session would still have its old job.
  if (job_before != 0) GW_RETURN_IF_ERROR(stores_.jobs.remove(job_before));
  spdlog::info("solving session={} method={} job={}", session.name(), session.method(), job);
  return session;
}

absl::StatusOr<ReceivedMatte> SolveRunner::begin_put(const v1::PutMatteRequest& header) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, stores_.sessions.find(header.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_SOLVE));
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_manifest(session, nodes_));
  if (const std::string own = archive_digest(manifest); own != header.archive()) {
    return absl::FailedPreconditionError(
        fmt::format("the matte was solved from the archive {}; session \"{}\" has the archive {}: export it "
                    "again and solve that",
                    header.archive(), session.name(), own));
  }
  GW_ASSIGN_OR_RETURN(const fs::path directory, stores_.mattes.arriving(session.name()));
  return ReceivedMatte(directory, session.pixel_count() * kMaxPixelBytes + kMaxHeaderBytes);
}

absl::StatusOr<v1::Session> SolveRunner::put(const v1::PutMatteRequest& header, ReceivedMatte matte) {
  GW_RETURN_IF_ERROR(matte.check(header.checksum()));
  PixelCount pixels;
  GW_ASSIGN_OR_RETURN(const MatteOutline outline, matte.verify(&pixels));
  GW_RETURN_IF_ERROR(matte.flush());
  SessionStore::Edit edit = stores_.sessions.edit();
  GW_ASSIGN_OR_RETURN(v1::Session session, edit.find(header.name()));
  GW_RETURN_IF_ERROR(edit.check_stays(session.name()));
  GW_RETURN_IF_ERROR(check_allows(session, v1::SESSION_ACTION_SOLVE));
  GW_RETURN_IF_ERROR(check_put(header, outline, session));
  const std::int64_t job_before = session.job();
  if (session.state() == v1::SESSION_STATE_DONE) GW_RETURN_IF_ERROR(edit.keep_finished(session));
  // A solve without a job: if the server ends before the next change, it cancels the solve on restart.
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_job();
  session.clear_reason();
  session.clear_solve_follows();
  session.set_method(outline.metadata.method());
  *session.mutable_options() = outline.metadata.options();
  session.set_solve_seconds(header.seconds());
  session.clear_solved_frames();
  clear_failures(session);
  count_tiles(
      {.object_pixels = pixels.object, .flagged_pixels = pixels.flagged, .unsolved_pixels = pixels.unsolved},
      session);
  GW_RETURN_IF_ERROR(edit.change(session));
  const absl::Status placed = [&]() -> absl::Status {
    const fs::path next = stores_.mattes.next(session.name());
    GW_RETURN_IF_ERROR(stores_.mattes.drop_next(session.name()));
    GW_RETURN_IF_ERROR(matte.place(next));
    return flush_directory(next.parent_path());
  }();
  if (!placed.ok()) {
    (void)cancel(edit, session, std::string(placed.message()));
    return placed;
  }
  GW_ASSIGN_OR_RETURN(const PositionedFile file, PositionedFile::open(stores_.mattes.next(session.name())));
  GW_ASSIGN_OR_RETURN(const MatteQuality quality, sampled_quality(file));
  GW_RETURN_IF_ERROR(stores_.sessions.keep_quality(session.name(), quality));
  fault_point("matte put");
  session.set_state(v1::SESSION_STATE_DONE);
  session.set_matte_ready(true);
  GW_RETURN_IF_ERROR(edit.change(session));
  GW_RETURN_IF_ERROR(edit.drop_finished(session.name()));
  GW_RETURN_IF_ERROR(stores_.mattes.finish(session.name()));
  if (job_before != 0) GW_RETURN_IF_ERROR(stores_.jobs.remove(job_before));
  spdlog::info("matte put session={} method={} seconds={:.1f}", session.name(), session.method(),
               session.solve_seconds());
  return session;
}

absl::Status SolveRunner::complete_survey(const v1::CompleteSurveyRequest& request) {
  v1::Session session;
  {
    SessionStore::Edit edit = stores_.sessions.edit();
    GW_ASSIGN_OR_RETURN(session, session_of(edit, request.lease()));
  }
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, read_manifest(session, nodes_));
  const FrameShape shape = shape_of(manifest.camera());
  v1::TileWork work = work_of(session, manifest);
  const std::vector<int> rows(work.survey_rows().begin(), work.survey_rows().end());
  const std::vector<double> seconds(request.row_seconds().begin(), request.row_seconds().end());
  const bool sensible = std::ranges::all_of(seconds, [](double s) { return s >= 0.0 && s < 1e6; });
  if (rows.empty() || seconds.size() != rows.size() || !sensible) {
    return absl::InvalidArgumentError(
        fmt::format("the survey of session \"{}\" must report the seconds of each of its {} rows",
                    session.name(), rows.size()));
  }
  const std::int64_t row_bytes = 2 * static_cast<std::int64_t>(shape.row_samples()) * manifest.frames_size();
  const std::int64_t max_bytes =
      std::min(kMaxTileBytes, kMaxTilePixels * manifest.frames_size() * shape.channels * 2);
  const std::vector<TileRange> tiles =
      row_tiles(shape.height_px, rows, seconds, row_bytes, max_bytes, min_tile_seconds_);
  work.clear_survey_rows();
  GW_RETURN_IF_ERROR(stores_.jobs.recut(attempt_of(request.lease()), work.SerializeAsString(), tiles));
  fault_point("survey committed");
  spdlog::info("surveyed session={} tiles={} solver={}", session.name(), tiles.size(), request.solver());
  progress_.update(request.lease());
  return absl::OkStatus();
}

absl::StatusOr<v1::Session> SolveRunner::pause(SessionStore::Edit& edit, v1::Session session) {
  session.set_state(v1::SESSION_STATE_PAUSED);
  session.set_reason("paused on request; resume with: glasswing resume " + session.name());
  GW_RETURN_IF_ERROR(edit.change(session));
  GW_RETURN_IF_ERROR(stores_.jobs.suspend(session.job()));
  spdlog::info("paused session={} tiles={} of={}", session.name(), session.tiles_done(),
               session.tile_count());
  return session;
}

absl::StatusOr<v1::Session> SolveRunner::resume(SessionStore::Edit& edit, v1::Session session) {
  const std::string name = session.name();
  GW_RETURN_IF_ERROR(stores_.jobs.retry(session.job()));
  if (session.state() == v1::SESSION_STATE_FAILED) {
    // Rejected frames become separate tiles, so that no other frame is solved again.
    if (!session.refused_frames().empty())
      GW_RETURN_IF_ERROR(stores_.jobs.add(session.job(), runs_of(session.refused_frames())));
    clear_failures(session);
  }
  GW_ASSIGN_OR_RETURN(const JobCounts counts, stores_.jobs.counts(session.job()));
  if (session.tile_count() > 0) count_tiles(counts, session);
  session.set_state(v1::SESSION_STATE_SOLVING);
  session.clear_reason();
  clock_.start(session);
  GW_RETURN_IF_ERROR(edit.change(session));
  GW_RETURN_IF_ERROR(stores_.jobs.resume(session.job()));
  spdlog::info("solving on session={} tiles={} of={}", name, session.tiles_done(), session.tile_count());
  if (counts.rests()) progress_.look_later(name);
  return session;
}

absl::StatusOr<v1::Session> SolveRunner::cancel(SessionStore::Edit& edit, v1::Session session,
                                                const std::string& reason) {
  // The job goes first: its absence makes a restarted server cancel again. The new matte's files go before
  // the session is done again, because files of a finished session count as finished.
  GW_RETURN_IF_ERROR(stores_.jobs.remove(session.job()));
  GW_RETURN_IF_ERROR(stores_.mattes.drop_next(session.name()));
  if (session.matte_ready()) {
    GW_ASSIGN_OR_RETURN(session, edit.finished(session.name()));
  } else {
    // Only the solve is given up: the session keeps its frames.
    session.set_state(v1::SESSION_STATE_CAPTURED);
    session.set_reason(reason);
    session.clear_job();
    count_tiles({}, session);
    session.clear_solved_frames();
    clear_failures(session);
  }
  GW_RETURN_IF_ERROR(edit.change(session));
  GW_RETURN_IF_ERROR(edit.drop_finished(session.name()));
  spdlog::info("solve cancelled session={}", session.name());
  return session;
}

absl::StatusOr<fs::path> SolveRunner::matte(const std::string& name, std::optional<int> frame) {
  SessionStore::Edit edit = stores_.sessions.edit();
  GW_ASSIGN_OR_RETURN(const v1::Session session, edit.find(name));
  // While a session with a matte is solved again, its record describes the new solve.
  v1::Session made = session;
  if (session.matte_ready() && session.state() != v1::SESSION_STATE_DONE) {
    GW_ASSIGN_OR_RETURN(made, edit.finished(name));
  }
  if (frame) {
    GW_RETURN_IF_ERROR(check_frame_is_solved(made, *frame));
    return session.matte_ready() ? stores_.mattes.finished(name, *frame) : stores_.mattes.next(name, *frame);
  }
  if (has_frame_files(made)) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" has a matte for each of {} frames; fetch them into a directory, -o {}/, "
                    "or one with --frame",
                    name, session.frame_count(), name));
  }
  if (!session.matte_ready()) {
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\" is {}; {}", name, state_of(session), way_to_matte(session)));
  }
  return stores_.mattes.finished(name);
}

absl::StatusOr<StoredMatte> SolveRunner::open_matte(const std::string& name, std::optional<int> frame,
                                                    const MattePart& part) {
  absl::Status status;
  // A new solve may replace the file meanwhile: then it is reopened.
  for (int attempt = 0; attempt < 2; ++attempt) {
    GW_ASSIGN_OR_RETURN(const fs::path path, matte(name, frame));
    absl::StatusOr<StoredMatte> opened = open_file(path, part);
    if (opened.ok() || !absl::IsDataLoss(opened.status())) return opened;
    status = opened.status();
  }
  spdlog::error("matte not served session={} error=\"{}\"", name, std::string(status.message()));
  return absl::DataLossError(
      fmt::format("{}; solve the session again: glasswing solve {}", std::string(status.message()), name));
}

absl::StatusOr<StoredMatte> SolveRunner::open_file(const fs::path& path, const MattePart& part) {
  const absl::StatusOr<PositionedFile> file = PositionedFile::open(path);
  if (!file.ok()) return absl::DataLossError(file.status().message());
  return leaves_nothing_out(*file, part) ? verified_.open(path) : part_of(*file, part);
}

absl::StatusOr<StoredMatte> SolveRunner::open_partial_matte(const std::string& name, const MattePart& part) {
  GW_ASSIGN_OR_RETURN(const v1::Session session, stores_.sessions.find(name));
  if (is_solved_by_frames(session)) {
    return absl::FailedPreconditionError(fmt::format(
        "session \"{}\" is a video: its solved frames can already be fetched into a directory", name));
  }
  const bool solving = session.state() == v1::SESSION_STATE_SOLVING, broke_off = rests_in_solve(session);
  const fs::path draft = stores_.mattes.draft(name);
  std::error_code ignored;
  const bool drafted = !session.matte_ready() && fs::exists(draft, ignored);
  if (drafted && !broke_off) return open_file(draft, part);
  if (!solving && !broke_off) return open_matte(name, std::nullopt, part);
  GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, stores_.jobs.tiles(session.job()));
  GW_ASSIGN_OR_RETURN(const fs::path directory, stores_.mattes.tiles(name));
  GW_ASSIGN_OR_RETURN(PositionedFile whole, stores_.mattes.unnamed());
  if (const absl::Status joined = join_tiles(tiles, directory, whole); absl::IsFailedPrecondition(joined)) {
    if (drafted) return open_file(draft, part);
    return absl::FailedPreconditionError(
        fmt::format("session \"{}\": {}", name, std::string(joined.message())));
  } else if (!joined.ok()) {
    return joined;
  }
  if (leaves_nothing_out(whole, part)) return StoredMatte(std::move(whole));
  return part_of(whole, part);
}

absl::StatusOr<StoredMatte> SolveRunner::part_of(const PositionedFile& file, const MattePart& part) const {
  GW_ASSIGN_OR_RETURN(PositionedFile made, stores_.mattes.unnamed());
  const absl::Status written = [&]() -> absl::Status {
    GW_ASSIGN_OR_RETURN(const PackedMatteReader matte, PackedMatteReader::open(file));
    return write_part(matte, part, [&](std::uint64_t offset, std::string_view bytes) {
      return made.write_at(offset, bytes);
    });
  }();
  if (absl::IsDataLoss(written)) {
    return absl::DataLossError(
        fmt::format("{} is damaged: {}", file.path().string(), std::string(written.message())));
  }
  GW_RETURN_IF_ERROR(written);
  return StoredMatte(std::move(made));
}

absl::Status SolveRunner::remove(const v1::Session& session) {
  return session.job() == 0 ? absl::OkStatus() : stores_.jobs.remove(session.job());
}

}  // namespace glasswing
