#include "server/sessions/session_store.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "core/storage/image_name.h"
#include "server/archives/session_archive.h"
#include "server/jobs/timed_job_store.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// What the job store knows this server by; it stays when the address changes.
absl::StatusOr<std::string> server_id(const fs::path& data) {
  const fs::path path = data / "server-id";
  if (!fs::exists(path)) GW_RETURN_IF_ERROR(write_file_durably(path, random_token()));
  return read_file(path);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Server>> Server::open(const ServerOptions& options) {
  const fs::path& data = options.data;
  std::unique_ptr<Server> server(new Server(data));
  for (const char* name : {"images", "mattes", "tiles"})
    GW_RETURN_IF_ERROR(make_directory_durably(data / name));
  GW_ASSIGN_OR_RETURN(server->catalogue_, Catalogue::open(data / "catalogue.sqlite"));
  GW_ASSIGN_OR_RETURN(server->calibrations_, CalibrationStore::open(data));
  GW_ASSIGN_OR_RETURN(const std::string id, server_id(data));
  GW_ASSIGN_OR_RETURN(
      std::unique_ptr<JobStore> jobs,
      open_job_store(options.jobs, data,
                     {.server_id = id, .server_address = options.address, .lease = options.lease}));
  server->jobs_ = timed(std::move(jobs));
  server->lease_ = options.lease;
  server->min_tile_seconds_ = options.min_tile_seconds;
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, server->catalogue_->list());
  const std::lock_guard lock(server->mutex_);
  GW_RETURN_IF_ERROR(server->drop_orphans(sessions));
  for (const v1::Session& session : sessions) GW_RETURN_IF_ERROR(server->take_up(session));
  server->finish_thread_ =
      std::jthread([self = server.get()](std::stop_token stop) { self->finish_solves(stop); });
  return server;
}

absl::Status Server::drop_orphans(const std::vector<v1::Session>& sessions) {
  GW_ASSIGN_OR_RETURN(const std::vector<std::int64_t> jobs, jobs_->own_jobs());
  for (const std::int64_t job : jobs) {
    if (std::ranges::count(sessions, job, &v1::Session::job) == 0) GW_RETURN_IF_ERROR(jobs_->remove(job));
  }
  return absl::OkStatus();
}

absl::Status Server::take_up(v1::Session session) {
  const std::string& name = session.name();
  if (session.state() != v1::SESSION_STATE_SOLVING && session.job() != 0) {
    const absl::Status held = jobs_->suspend(session.job());
    // A session that is done needs its tiles no more, and they may be gone, or in another store.
    if (!held.ok() && !absl::IsNotFound(held)) return held;
  }
  switch (session.state()) {
    case v1::SESSION_STATE_CAPTURING:
      session.set_state(v1::SESSION_STATE_PAUSED);
      session.set_reason(fmt::format("the server was restarted; go on with: glasswing resume {}", name));
      return catalogue_->update(session);
    case v1::SESSION_STATE_SOLVING: {
      start_solve_clock(session);
      // Its last tile may have come just before the end, or its cancelling begun.
      GW_ASSIGN_OR_RETURN(const JobCounts counts, jobs_->counts(session.job()));
      if (counts.tiles == 0)
        return cancel_solve(session,
                            fmt::format("its tiles are gone; solve it again: glasswing solve {}", name))
            .status();
      count_tiles(counts, session);
      if (has_frame_files(session) && !session.matte_ready()) {
        GW_ASSIGN_OR_RETURN(const std::vector<TileState> tiles, jobs_->tiles(session.job()));
        note_solved_frames(tiles, session);
      }
      GW_RETURN_IF_ERROR(catalogue_->update(session));
      GW_RETURN_IF_ERROR(jobs_->resume(session.job()));
      if (counts.rests()) to_finish_.insert(name);
      return absl::OkStatus();
    }
    case v1::SESSION_STATE_DONE:
      if (!session.matte_ready()) {  // of a server that did not say so
        session.set_matte_ready(true);
        GW_RETURN_IF_ERROR(catalogue_->update(session));
      }
      GW_RETURN_IF_ERROR(catalogue_->drop_finished(name));
      return mattes_.finish(name);
    default:
      return absl::OkStatus();
  }
}

Server::~Server() {
  {
    const std::lock_guard lock(mutex_);
    if (!capturing_.empty() && wish_ == Wish::kNone) wish_ = Wish::kPause;
    capture_thread_.request_stop();
  }
  join_capture();
  finish_thread_ = {};
}

void Server::join_capture() {
  if (capture_thread_.joinable()) capture_thread_.join();
}

void Server::announce() {
  ++change_count_;
  changed_.notify_all();
}

absl::Status Server::change(const v1::Session& session) {
  GW_RETURN_IF_ERROR(catalogue_->update(session));
  live_.erase(session.name());
  announce();
  return absl::OkStatus();
}

std::int64_t Server::wait_change(std::int64_t seen, std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, timeout, [&] { return change_count_ > seen; });
  return change_count_;
}

absl::Status Server::check_stays(const std::string& name) const {
  if (!going_.contains(name)) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format("session \"{}\" is being deleted", name));
}

absl::StatusOr<v1::Session> Server::find_locked(const std::string& name) {
  GW_ASSIGN_OR_RETURN(const v1::Session stored, catalogue_->find(name));
  const auto live = live_.find(name);
  if (live == live_.end()) return stored;
  v1::Session session = live->second;
  session.set_note(stored.note());
  *session.mutable_tags() = stored.tags();
  *session.mutable_copies() = stored.copies();
  return session;
}

absl::StatusOr<v1::Session> Server::find(const std::string& name) {
  const std::lock_guard lock(mutex_);
  return find_locked(name);
}

absl::StatusOr<std::vector<v1::Session>> Server::list(const v1::ListSessionsRequest& request) {
  GW_RETURN_IF_ERROR(matches({}, request).status());  // with nothing to list, too
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> stored, catalogue_->list());
  std::vector<v1::Session> sessions;
  for (const v1::Session& each : stored) {
    absl::StatusOr<v1::Session> session = find(each.name());
    if (absl::IsNotFound(session.status())) continue;  // deleted just now
    GW_RETURN_IF_ERROR(session.status());
    GW_ASSIGN_OR_RETURN(const bool wanted, matches(*session, request));
    if (!wanted) continue;
    // Long, and of no use in a list.
    session->clear_plan();
    session->clear_unproven();
    sessions.push_back(*std::move(session));
  }
  return sessions;
}

absl::StatusOr<v1::Session> Server::annotate(const v1::AnnotateSessionRequest& request) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(catalogue_->annotate(request).status());
  announce();
  return find_locked(request.name());
}

absl::StatusOr<std::vector<v1::StepEvent>> Server::steps(const std::string& name, size_t first) {
  if (auto events = steps_.events(name, first)) return *std::move(events);
  GW_ASSIGN_OR_RETURN(const v1::Session session, find(name));
  if (session.state() == v1::SESSION_STATE_CAPTURING || session.archive_address().empty())
    return std::vector<v1::StepEvent>();
  GW_ASSIGN_OR_RETURN(const v1::CaptureManifest manifest, SessionArchive(session).manifest());
  return proven_steps(manifest);
}

absl::StatusOr<std::string> Server::store_image(const std::string& png) {
  std::string name = image_name(png);
  GW_RETURN_IF_ERROR(write_file_durably(data_ / "images" / name, png));
  return name;
}

}  // namespace glasswing
