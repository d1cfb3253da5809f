// The server's tiles: leased to solvers, and what these hand in made into mattes.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/checksum.h"
#include "core/base/fault_point.h"
#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/base/version.h"
#include "core/matte/matte_file.h"
#include "core/pattern/method_options.h"
#include "core/pattern/plan.h"
#include "core/service/service.h"
#include "core/storage/matte_files.h"
#include "server/archives/replicas.h"
#include "server/metrics/server_metrics.h"
#include "server/sessions/session_state.h"
#include "server/sessions/session_store.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

void note_refused_frames(const v1::CompleteTileRequest& header, v1::Session& session) {
  for (const v1::RefusedFrame& refused : header.refused()) {
    if (has_number(session.refused_frames(), refused.frame())) continue;
    session.add_refused_frames(refused.frame());
    std::sort(session.mutable_refused_frames()->begin(), session.mutable_refused_frames()->end());
    // That of the first one tells most: what follows it often fails alike.
    if (session.refused_frames(0) == refused.frame()) session.set_refusal(refused.error());
  }
}

// What this server's own methods compute; solvers must agree.
absl::Status check_versions(const v1::ClaimTileRequest& request) {
  if (request.version() != kVersion) {
    return absl::FailedPreconditionError(fmt::format(
        "solver \"{}\" is Glasswing {}, the server {}; install the same on both", request.solver(),
        request.version().empty() ? "of no known version" : request.version(), kVersion));
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

// For people.
std::string describe(const Lease& lease, const v1::ClaimTileResponse& work) {
  if (!work.survey_rows().empty()) return fmt::format("surveying {}", lease.session);
  if (work.frame_count() == 0) return fmt::format("solving {} tile {}", lease.session, lease.id.tile);
  return fmt::format("solving {} frames {} to {}", lease.session, lease.range.first,
                     lease.range.first + lease.range.count - 1);
}

absl::Status check_rows(const MatteOutline& matte, const TileRange& rows, const v1::Session& session) {
  if (matte.y0_px == rows.first && matte.height_px == rows.count && matte.x0_px == 0 &&
      std::int64_t{matte.width_px} * matte.metadata.height_px() == session.pixel_count())
    return absl::OkStatus();
  return absl::InvalidArgumentError(fmt::format(
      "the tile of session \"{}\" holds {} rows of {} px from row {}; it must hold {} rows of the whole "
      "picture from row {}",
      session.name(), matte.height_px, matte.width_px, matte.y0_px, rows.count, rows.first));
}

}  // namespace

absl::StatusOr<v1::ClaimTileResponse> Server::claim(const v1::ClaimTileRequest& request) {
  if (const absl::Status same = check_versions(request); !same.ok()) {
    fleet_.refused(request.solver(), std::string(same.message()));
    return same;
  }
  static const std::vector<std::string> computed = all_that_is_computed();
  v1::ClaimTileResponse response;
  GW_ASSIGN_OR_RETURN(const std::optional<Lease> lease,
                      jobs_->claim(request.solver(), computed, request.ahead()));
  fleet_.claimed(request.solver());
  if (!lease) {
    if (!request.ahead()) rig_.note(request.solver(), "waiting for work");
    return response;
  }
  const bool again = lease->id.attempt > 1;
  (again ? server_metrics().tiles_claimed_again : server_metrics().tiles_claimed).Increment();
  if (!response.ParseFromString(lease->work)) {
    return absl::DataLossError(
        fmt::format("the job store's entry of session \"{}\" cannot be read", lease->session));
  }
  response.mutable_lease()->set_session(lease->session);
  response.mutable_lease()->set_job(lease->id.job);
  response.mutable_lease()->set_tile(lease->id.tile);
  response.mutable_lease()->set_attempt(lease->id.attempt);
  response.set_lease_ms(lease_.count());
  if (response.method() == kRampMethod) {
    response.set_first_frame(lease->range.first);
    response.set_frame_count(lease->range.count);
  } else {
    response.set_first_row(lease->range.first);
    response.set_row_count(lease->range.count);
  }
  if (lease->own) {
    // Copies may have been made since.
    GW_ASSIGN_OR_RETURN(const v1::Session session, catalogue_->find(lease->session));
    for (const std::string& address : replica_addresses(session, rig_)) response.add_copy_addresses(address);
  } else {
    response.set_server_address(lease->server_address);
  }
  rig_.note(request.solver(), describe(*lease, response));
  return response;
}

absl::Status Server::keep(const v1::TileLease& lease) {
  return jobs_->renew(attempt_of(lease));
}

absl::StatusOr<v1::Session> Server::session_of(const v1::TileLease& lease) {
  GW_RETURN_IF_ERROR(check_name("session", lease.session()));
  const absl::StatusOr<v1::Session> session = find_locked(lease.session());
  if (session.ok() && lease.job() != 0 && session->job() == lease.job()) return session;
  if (!session.ok() && !absl::IsNotFound(session.status())) return session.status();
  return absl::AbortedError(
      fmt::format("session \"{}\" is not being solved in job {} any more", lease.session(), lease.job()));
}

absl::StatusOr<std::optional<FrameMattes>> Server::frames_of(const v1::TileLease& lease) {
  {
    const std::lock_guard lock(mutex_);
    GW_ASSIGN_OR_RETURN(const v1::Session session, session_of(lease));
    if (!is_solved_by_frames(session)) return std::nullopt;
  }
  GW_ASSIGN_OR_RETURN(const TileState tile, jobs_->tile(attempt_of(lease)));
  GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(lease.session()));
  return FrameMattes(directory, tile.range.first, tile.range.count);
}

absl::Status Server::complete(const v1::CompleteTileRequest& header, const std::string& matte) {
  fault_point("tile received");
  const v1::TileLease& lease = header.lease();
  const TileAttempt attempt = attempt_of(lease);
  v1::Session session;
  {
    const std::lock_guard lock(mutex_);
    GW_ASSIGN_OR_RETURN(session, session_of(lease));
  }
  GW_ASSIGN_OR_RETURN(const TileState tile, jobs_->tile(attempt));
  const std::string checksum = checksum_of(matte);
  const std::string file = tile_name(lease.job(), lease.tile(), lease.attempt(), checksum);
  if (!tile.is_done()) {
    if (header.checksum() != checksum) {
      return absl::DataLossError(
          fmt::format("the tile's checksum is {}, announced was {}", checksum, header.checksum()));
    }
    GW_ASSIGN_OR_RETURN(const MatteOutline outline, outline_of(matte));
    GW_RETURN_IF_ERROR(check_rows(outline, tile.range, session));
    GW_ASSIGN_OR_RETURN(const fs::path directory, mattes_.tiles(lease.session()));
    const absl::Status written = write_file_durably(directory / file, matte);
    if (absl::IsResourceExhausted(written)) {
      const std::lock_guard lock(mutex_);
      wait_for_room(session, written);  // the solver keeps the tile, and asks again
    }
    GW_RETURN_IF_ERROR(written);
    fault_point("tile written");
  }
  return done(header, attempt, file);
}

absl::Status Server::complete(const v1::CompleteTileRequest& header, FrameMattes mattes) {
  fault_point("tile received");
  GW_RETURN_IF_ERROR(mattes.finish());
  GW_RETURN_IF_ERROR(complete_frames(header, mattes));
  return done(header, attempt_of(header.lease()), fmt::format("attempt {}", header.lease().attempt()));
}

absl::Status Server::complete_frames(const v1::CompleteTileRequest& header, FrameMattes& mattes) {
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::Session session, session_of(header.lease()));
  GW_ASSIGN_OR_RETURN(const TileState tile, jobs_->tile(attempt_of(header.lease())));
  if (tile.is_done()) return absl::OkStatus();  // by this attempt, or it will be refused
  for (int frame = tile.range.first; frame < tile.range.first + tile.range.count; ++frame) {
    const bool refused = std::ranges::count(header.refused(), frame, &v1::RefusedFrame::frame) > 0;
    if (!mattes.has(frame) && !refused && !has_number(session.lost_frames(), frame))
      return absl::InvalidArgumentError(fmt::format("there is no matte of frame {}", frame));
  }
  // A void attempt must not replace what a later one has made.
  GW_RETURN_IF_ERROR(jobs_->renew(attempt_of(header.lease())));
  const std::string& name = session.name();
  if (has_frame_files(session)) {
    GW_RETURN_IF_ERROR(mattes_.make_next(name));
    GW_RETURN_IF_ERROR(mattes.place([&](int frame) { return mattes_.next(name, frame); }));
  } else {
    GW_RETURN_IF_ERROR(mattes.place([&](int) { return mattes_.next(name); }));
  }
  fault_point("tile written");
  if (header.refused_size() == 0) return absl::OkStatus();
  // Before the tile is done: a crash in between must not make them pass for solved.
  note_refused_frames(header, session);
  return change(session);
}

absl::Status Server::done(const v1::CompleteTileRequest& header, const TileAttempt& attempt,
                          const std::string& result) {
  const v1::TileLease& lease = header.lease();
  const absl::Status completed = jobs_->complete(attempt, {.result = result,
                                                           .object_pixels = header.object_pixel_count(),
                                                           .flagged_pixels = header.flagged_pixel_count(),
                                                           .seconds = header.seconds()});
  if (absl::IsUnavailable(completed)) {
    // It may be done all the same, and the solver may not live to ask again.
    const std::lock_guard lock(mutex_);
    look_whether_finished(lease.session());
  }
  GW_RETURN_IF_ERROR(completed);
  fault_point("tile committed");
  fleet_.completed(header.solver(), header.seconds());
  spdlog::info("tile done session={} job={} tile={} attempt={} solver={} seconds={:.2f}", lease.session(),
               lease.job(), lease.tile(), lease.attempt(), header.solver(), header.seconds());
  note_progress(lease);
  return absl::OkStatus();
}

void Server::note_progress(const v1::TileLease& lease) {
  std::shared_ptr<SingleFlight> counting;
  {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<SingleFlight>& shared = counting_[lease.session()];
    if (shared == nullptr) shared = std::make_shared<SingleFlight>();
    counting = shared;
  }
  counting->run([&] {
    const absl::Status counted = count_progress(lease);
    if (counted.ok() || absl::IsAborted(counted)) return;  // cancelled just now
    // The tile is done all the same.
    const std::lock_guard lock(mutex_);
    look_whether_finished(lease.session());
  });
}

absl::Status Server::count_progress(const v1::TileLease& lease) {
  GW_ASSIGN_OR_RETURN(const JobCounts counts, jobs_->counts(lease.job()));
  const std::lock_guard lock(mutex_);
  GW_ASSIGN_OR_RETURN(v1::Session session, session_of(lease));
  if (session.state() != v1::SESSION_STATE_SOLVING && !rests_in_solve(session)) return absl::OkStatus();
  count_tiles(counts, session);
  session.clear_reason();
  if (has_frame_files(session) && !session.matte_ready()) {
    GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, jobs_->tiles(lease.job()));
    note_solved_frames(tiles, session);
  }
  if (const auto began = solve_began_.find(session.name()); began != solve_began_.end())
    session.set_solve_seconds(std::chrono::duration<double>(monotonic_now() - began->second).count());
  // The store has it: the catalogue need not be told of every tile.
  live_[session.name()] = session;
  announce();
  if (counts.rests() && session.state() == v1::SESSION_STATE_SOLVING) look_whether_finished(session.name());
  return absl::OkStatus();
}

absl::Status Server::fail(const v1::FailTileRequest& request) {
  const v1::TileLease& lease = request.lease();
  if (request.handed_back()) {
    spdlog::info("tile handed back session={} tile={} attempt={} solver={}", lease.session(), lease.tile(),
                 lease.attempt(), request.solver());
    return jobs_->hand_back(attempt_of(lease));
  }
  fleet_.failed(request.solver(), lease.session(), lease.tile(), request.error());
  GW_ASSIGN_OR_RETURN(const bool quarantined,
                      jobs_->fail(attempt_of(lease), request.error(), request.permanent()));
  spdlog::error("tile failed session={} tile={} attempt={} solver={} quarantined={} error=\"{}\"",
                lease.session(), lease.tile(), lease.attempt(), request.solver(), quarantined,
                request.error());
  if (!quarantined) return absl::OkStatus();
  server_metrics().tiles_quarantined.Increment();
  GW_ASSIGN_OR_RETURN(const TileState tile, jobs_->tile(attempt_of(lease)));
  {
    const std::lock_guard lock(mutex_);
    GW_ASSIGN_OR_RETURN(v1::Session session, session_of(lease));
    v1::QuarantinedTile& named = *session.add_quarantined();
    named.set_tile(lease.tile());
    named.set_first(tile.range.first);
    named.set_count(tile.range.count);
    named.set_error(request.error());
    if (session.state() != v1::SESSION_STATE_SOLVING) return change(session);
    if (request.permanent()) {
      // The others would fail alike. Those that are worked on may still come, and are kept for a later try.
      GW_RETURN_IF_ERROR(jobs_->suspend(lease.job()));
      session.set_state(v1::SESSION_STATE_FAILED);
      session.set_reason(request.error());
      spdlog::error("solve failed session={} tile={} reason=\"{}\"", session.name(), lease.tile(),
                    request.error());
      return change(session);
    }
    GW_RETURN_IF_ERROR(change(session));
  }
  note_progress(lease);
  return absl::OkStatus();
}

absl::StatusOr<v1::GetFleetResponse> Server::fleet() {
  GW_ASSIGN_OR_RETURN(std::vector<JobState> jobs, jobs_->jobs());
  GW_ASSIGN_OR_RETURN(const std::vector<LeaseState> leases, jobs_->leases());
  for (JobState& job : jobs) {
    const absl::StatusOr<v1::Session> session = find(job.session);
    // Being surveyed: its one tile is not what it will be cut to.
    if (job.own && session.ok() && session->tile_count() == 0) job.counts.tiles = 0;
  }
  return fleet_.describe(rig_.solvers(), jobs, leases, jobs_->title());
}

}  // namespace glasswing
