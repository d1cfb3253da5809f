#include "server/dispatch/tile_dispatcher.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/base/version.h"
#include "core/file/fault_point.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"
#include "core/method/methods.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/tile_work.pb.h"
#include "server/archives/replicas.h"
#include "server/metrics/server_metrics.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxSpoiled = 2;  // mattes, until a solver gets no more work

void note_refused_frames(const v1::CompleteTileRequest& header, v1::Session& session) {
  for (const v1::RefusedFrame& refused : header.refused()) {
    if (has_number(session.refused_frames(), refused.frame())) continue;
    session.add_refused_frames(refused.frame());
    std::sort(session.mutable_refused_frames()->begin(), session.mutable_refused_frames()->end());
    // The first frame's error: later ones often fail for the same reason.
    if (session.refused_frames(0) == refused.frame()) session.set_refusal(refused.error());
  }
}

// Solvers must compute what this server's own methods do.
absl::Status check_versions(const v1::ClaimTileRequest& request) {
  if (request.version() != kVersion) {
    return absl::FailedPreconditionError(fmt::format(
        "solver \"{}\" is Glasswing {}, the server {}; install the same on both", request.solver(),
        request.version().empty() ? "of unknown version" : request.version(), kVersion));
  }
  for (const auto& [method, version] : method_versions()) {
    const auto theirs = request.method_versions().find(method);
    if (theirs != request.method_versions().end() && theirs->second == version) continue;
    return absl::FailedPreconditionError(fmt::format(
        "solver \"{}\" computes {}, the server expects version {}: their mattes would differ; install the "
        "same build on both",
        request.solver(),
        theirs == request.method_versions().end() ? fmt::format("no \"{}\"", method)
                                                  : fmt::format("\"{}\" version {}", method, theirs->second),
        version));
  }
  return absl::OkStatus();
}

std::vector<std::string> all_that_is_computed() {
  std::vector<std::string> all;
  for (const auto& [method, version] : method_versions()) all.push_back(computes(method));
  return all;
}

// Excluding the disk's errors.
bool is_no_matte(const absl::Status& verified) {
  return absl::IsDataLoss(verified) || absl::IsFailedPrecondition(verified);
}

// The solver's activity in `glasswing nodes`.
std::string describe(const Lease& lease, const v1::ClaimTileResponse& work) {
  if (!work.survey_rows().empty()) return fmt::format("surveying {}", lease.session);
  if (work.frame_count() == 0) return fmt::format("solving {} tile {}", lease.session, lease.id.tile);
  return fmt::format("solving {} frames {} to {}", lease.session, lease.range.first,
                     lease.range.first + lease.range.count - 1);
}

}  // namespace

absl::StatusOr<v1::ClaimTileResponse> claimed_tile(const Lease& lease) {
  v1::TileWork work;
  if (!work.ParseFromString(lease.work)) {
    return absl::DataLossError(
        fmt::format("the job store's entry of session \"{}\" cannot be read", lease.session));
  }
  v1::ClaimTileResponse response;
  response.set_method(work.method());
  *response.mutable_options() = work.options();
  response.set_archive_address(work.archive_address());
  *response.mutable_survey_rows() = work.survey_rows();
  response.mutable_lease()->set_session(lease.session);
  response.mutable_lease()->set_job(lease.id.job);
  response.mutable_lease()->set_tile(lease.id.tile);
  response.mutable_lease()->set_attempt(lease.id.attempt);
  if (response.method() == kRampMethod) {
    response.set_first_frame(lease.range.first);
    response.set_frame_count(lease.range.count);
  } else {
    response.set_first_row(lease.range.first);
    response.set_row_count(lease.range.count);
  }
  if (!lease.own) response.set_server_address(lease.server_address);
  return response;
}

absl::StatusOr<v1::ClaimTileResponse> TileDispatcher::claim(const v1::ClaimTileRequest& request) {
  if (const absl::Status same = check_versions(request); !same.ok()) {
    fleet_.refused(request.solver(), std::string(same.message()));
    return same;
  }
  if (const int count = fleet_.spoiled_by(request.solver()); count >= kMaxSpoiled) {
    const std::string why = fmt::format(
        "solver \"{}\" submitted {} corrupt mattes and gets no more work: test its machine's memory and "
        "disk; "
        "it is forgotten after being stopped for ten minutes",
        request.solver(), count);
    fleet_.refused(request.solver(), why);
    return absl::FailedPreconditionError(why);
  }
  static const std::vector<std::string> computed = all_that_is_computed();
  GW_ASSIGN_OR_RETURN(const std::optional<Lease> lease,
                      stores_.jobs.claim(request.solver(), computed, request.ahead()));
  fleet_.claimed(request.solver());
  if (!lease) {
    v1::ClaimTileResponse draft = drafts_.claim(request.solver());
    if (draft.has_lease()) {
      nodes_.note(request.solver(),
                  fmt::format("drafting {} tile {}", draft.lease().session(), draft.lease().tile()));
    } else if (!request.ahead()) {
      nodes_.note(request.solver(), "waiting for work");
    }
    return draft;
  }
  const bool again = lease->id.attempt > 1;
  (again ? server_metrics().tiles_claimed_again : server_metrics().tiles_claimed).Increment();
  GW_ASSIGN_OR_RETURN(v1::ClaimTileResponse response, claimed_tile(*lease));
  response.set_lease_ms(lease_.count());
  if (lease->own) {
    // Replicas may have been made after the job.
    GW_ASSIGN_OR_RETURN(const v1::Session session, stores_.sessions.stored(lease->session));
    for (const std::string& address : replica_addresses(session, nodes_))
      response.add_copy_addresses(address);
  }
  nodes_.note(request.solver(), describe(*lease, response));
  return response;
}

absl::Status TileDispatcher::renew(const v1::TileLease& lease) {
  return Drafts::is_draft(lease) ? drafts_.renew(lease) : stores_.jobs.renew(attempt_of(lease));
}

absl::StatusOr<std::optional<FrameMattes>> TileDispatcher::frames_of(const v1::TileLease& lease) {
  if (Drafts::is_draft(lease)) return std::nullopt;
  {
    SessionStore::Edit edit = stores_.sessions.edit();
    GW_ASSIGN_OR_RETURN(const v1::Session session, session_of(edit, lease));
    if (!is_solved_by_frames(session)) return std::nullopt;
  }
  GW_ASSIGN_OR_RETURN(const TileState tile, stores_.jobs.tile(attempt_of(lease)));
  GW_ASSIGN_OR_RETURN(const fs::path directory, stores_.mattes.tiles(lease.session()));
  return FrameMattes(directory, tile.range.first, tile.range.count);
}

absl::StatusOr<ReceivedMatte> TileDispatcher::rows_of(const v1::TileLease& lease) {
  if (Drafts::is_draft(lease)) {
    GW_RETURN_IF_ERROR(drafts_.check(lease));
  } else {
    SessionStore::Edit edit = stores_.sessions.edit();
    GW_RETURN_IF_ERROR(session_of(edit, lease).status());
  }
  GW_ASSIGN_OR_RETURN(const fs::path directory, stores_.mattes.tiles(lease.session()));
  return ReceivedMatte(directory);
}

absl::Status TileDispatcher::complete(const v1::CompleteTileRequest& header, ReceivedMatte matte) {
  fault_point("tile received");
  const absl::Status arrived = matte.check(header.checksum());
  const absl::StatusOr<MatteOutline> outline = arrived.ok() ? matte.verify() : arrived;
  if (arrived.ok() && is_no_matte(outline.status())) return spoiled(header, outline.status());
  if (Drafts::is_draft(header.lease())) return drafts_.complete(header, outline, matte);
  const v1::TileLease& lease = header.lease();
  v1::Session session;
  {
    SessionStore::Edit edit = stores_.sessions.edit();
    GW_ASSIGN_OR_RETURN(session, session_of(edit, lease));
  }
  const TileAttempt attempt = attempt_of(lease);
  GW_ASSIGN_OR_RETURN(const TileState tile, stores_.jobs.tile(attempt));
  const std::string file = tile_name(lease.job(), lease.tile(), lease.attempt(), matte.checksum());
  if (!tile.is_done()) {
    GW_RETURN_IF_ERROR(outline.ok() ? check_rows(*outline, tile.range, session) : absl::OkStatus());
    const absl::Status stored = outline.ok() ? store_rows(lease.session(), file, matte) : outline.status();
    if (absl::IsResourceExhausted(stored)) {
      SessionStore::Edit edit = stores_.sessions.edit();
      wait_for_room(edit, session, stored);  // the solver keeps the tile, and asks again
    }
    GW_RETURN_IF_ERROR(stored);
    fault_point("tile written");
  }
  return done(header, attempt, file);
}

absl::Status TileDispatcher::store_rows(const std::string& session, const std::string& file,
                                        ReceivedMatte& matte) {
  GW_ASSIGN_OR_RETURN(const fs::path directory, stores_.mattes.tiles(session));
  GW_RETURN_IF_ERROR(matte.flush());
  GW_RETURN_IF_ERROR(matte.place(directory / file));
  return flush_directory(directory);
}

absl::Status TileDispatcher::complete(const v1::CompleteTileRequest& header, FrameMattes mattes) {
  fault_point("tile received");
  GW_RETURN_IF_ERROR(mattes.finish());
  const absl::Status whole = mattes.verify();
  if (is_no_matte(whole)) return spoiled(header, whole);
  GW_RETURN_IF_ERROR(whole);
  GW_RETURN_IF_ERROR(place_frames(header, mattes));
  return done(header, attempt_of(header.lease()), fmt::format("attempt {}", header.lease().attempt()));
}

absl::Status TileDispatcher::spoiled(const v1::CompleteTileRequest& header, const absl::Status& why) {
  fleet_.spoiled(header.solver());
  v1::FailTileRequest request;
  *request.mutable_lease() = header.lease();
  request.set_solver(header.solver());
  request.set_error(fmt::format("solver \"{}\" submitted a corrupt matte: {}", header.solver(),
                                std::string(why.message())));
  GW_RETURN_IF_ERROR(fail(request));
  return absl::AbortedError(request.error());
}

absl::Status TileDispatcher::place_frames(const v1::CompleteTileRequest& header, FrameMattes& mattes) {
  SessionStore::Edit edit = stores_.sessions.edit();
  GW_ASSIGN_OR_RETURN(v1::Session session, session_of(edit, header.lease()));
  GW_ASSIGN_OR_RETURN(const TileState tile, stores_.jobs.tile(attempt_of(header.lease())));
  if (tile.is_done()) return absl::OkStatus();  // by this attempt, or it will be refused
  for (int frame = tile.range.first; frame < tile.range.first + tile.range.count; ++frame) {
    const bool refused = std::ranges::count(header.refused(), frame, &v1::RefusedFrame::frame) > 0;
    if (!mattes.has(frame) && !refused && !has_number(session.lost_frames(), frame))
      return absl::InvalidArgumentError(fmt::format("there is no matte of frame {}", frame));
  }
  // A void attempt must not replace the files of a later one.
  GW_RETURN_IF_ERROR(stores_.jobs.renew(attempt_of(header.lease())));
  const std::string& name = session.name();
  if (has_frame_files(session)) {
    GW_RETURN_IF_ERROR(stores_.mattes.make_next(name));
    GW_RETURN_IF_ERROR(mattes.place([&](int frame) { return stores_.mattes.next(name, frame); }));
  } else {
    GW_RETURN_IF_ERROR(mattes.place([&](int) { return stores_.mattes.next(name); }));
  }
  fault_point("tile written");
  if (header.refused_size() == 0) return absl::OkStatus();
  // Before the tile is done: after a crash in between, rejected frames must not count as solved.
  note_refused_frames(header, session);
  return edit.change(session);
}

absl::Status TileDispatcher::done(const v1::CompleteTileRequest& header, const TileAttempt& attempt,
                                  const std::string& result) {
  const v1::TileLease& lease = header.lease();
  const absl::Status completed =
      stores_.jobs.complete(attempt, {.result = result,
                                      .object_pixels = header.object_pixel_count(),
                                      .flagged_pixels = header.flagged_pixel_count(),
                                      .unsolved_pixels = header.unsolved_pixel_count(),
                                      .seconds = header.seconds()});
  // The tile may still be done, and the solver may not live to ask again.
  if (absl::IsUnavailable(completed)) progress_.look_later(lease.session());
  GW_RETURN_IF_ERROR(completed);
  fault_point("tile committed");
  fleet_.completed(header.solver(), header.seconds());
  spdlog::info("tile done session={} job={} tile={} attempt={} solver={} seconds={:.2f}", lease.session(),
               lease.job(), lease.tile(), lease.attempt(), header.solver(), header.seconds());
  progress_.update(lease);
  return absl::OkStatus();
}

absl::Status TileDispatcher::fail(const v1::FailTileRequest& request) {
  const v1::TileLease& lease = request.lease();
  if (Drafts::is_draft(lease)) {
    drafts_.fail(request);
    return absl::OkStatus();
  }
  if (request.handed_back()) {
    spdlog::info("tile handed back session={} tile={} attempt={} solver={}", lease.session(), lease.tile(),
                 lease.attempt(), request.solver());
    return stores_.jobs.hand_back(attempt_of(lease));
  }
  fleet_.failed(request.solver(), lease.session(), lease.tile(), request.error());
  GW_ASSIGN_OR_RETURN(const bool quarantined,
                      stores_.jobs.fail(attempt_of(lease), request.error(), request.permanent()));
  spdlog::error("tile failed session={} tile={} attempt={} solver={} quarantined={} error=\"{}\"",
                lease.session(), lease.tile(), lease.attempt(), request.solver(), quarantined,
                request.error());
  if (!quarantined) return absl::OkStatus();
  server_metrics().tiles_quarantined.Increment();
  GW_ASSIGN_OR_RETURN(const bool goes_on, note_quarantined(request));
  if (goes_on) progress_.update(lease);
  return absl::OkStatus();
}

absl::StatusOr<bool> TileDispatcher::note_quarantined(const v1::FailTileRequest& request) {
  const v1::TileLease& lease = request.lease();
  GW_ASSIGN_OR_RETURN(const TileState tile, stores_.jobs.tile(attempt_of(lease)));
  SessionStore::Edit edit = stores_.sessions.edit();
  GW_ASSIGN_OR_RETURN(v1::Session session, session_of(edit, lease));
  v1::QuarantinedTile& named = *session.add_quarantined();
  named.set_tile(lease.tile());
  named.set_first(tile.range.first);
  named.set_count(tile.range.count);
  named.set_error(request.error());
  const bool goes_on = session.state() == v1::SESSION_STATE_SOLVING && !request.permanent();
  if (session.state() == v1::SESSION_STATE_SOLVING && request.permanent()) {
    // The other tiles would fail the same way. Leased ones may still be completed, and are kept for a later
    // retry.
    GW_RETURN_IF_ERROR(stores_.jobs.suspend(lease.job()));
    session.set_state(v1::SESSION_STATE_FAILED);
    // Prefixed with its author: the text is whatever the solver sends.
    session.set_reason(fmt::format("solver {}: {}", request.solver(), printable(request.error())));
    spdlog::error("solve failed session={} tile={} reason=\"{}\"", session.name(), lease.tile(),
                  request.error());
  }
  GW_RETURN_IF_ERROR(edit.change(session));
  return goes_on;
}

absl::StatusOr<v1::GetFleetResponse> TileDispatcher::fleet() {
  GW_ASSIGN_OR_RETURN(std::vector<JobState> jobs, stores_.jobs.jobs());
  GW_ASSIGN_OR_RETURN(const std::vector<LeaseState> leases, stores_.jobs.leases());
  for (JobState& job : jobs) {
    const absl::StatusOr<v1::Session> session = stores_.sessions.find(job.session);
    // While a session is surveyed, the number of its tiles is not known yet.
    if (job.own && session.ok() && session->tile_count() == 0) job.counts.tiles = 0;
  }
  return fleet_.describe(nodes_.solvers(), jobs, leases, stores_.jobs.title());
}

}  // namespace glasswing
