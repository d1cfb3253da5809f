#include "server/services/server.h"

#include <utility>

#include "core/base/file.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "server/jobs/timed_job_store.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// The job store's name of this server, which stays when its address changes.
absl::StatusOr<std::string> server_id(const fs::path& data) {
  const fs::path path = data / "server-id";
  if (!fs::exists(path)) GW_RETURN_IF_ERROR(write_file_durably(path, random_token()));
  return read_file(path);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Server>> Server::open(const ServerOptions& options) {
  const fs::path& data = options.data;
  for (const char* name : {"images", "mattes", "tiles"})
    GW_RETURN_IF_ERROR(make_directory_durably(data / name));
  GW_ASSIGN_OR_RETURN(std::unique_ptr<SessionStore> sessions, SessionStore::open(data));
  GW_ASSIGN_OR_RETURN(std::unique_ptr<CalibrationStore> calibrations, CalibrationStore::open(data));
  GW_ASSIGN_OR_RETURN(const std::string id, server_id(data));
  GW_ASSIGN_OR_RETURN(
      std::unique_ptr<JobStore> jobs,
      open_job_store(options.jobs, data,
                     {.server_id = id, .server_address = options.address, .lease = options.lease}));
  std::unique_ptr<Server> server(
      new Server(options, std::move(sessions), timed(std::move(jobs)), std::move(calibrations)));
  GW_RETURN_IF_ERROR(server->take_up());
  return server;
}

Server::Server(const ServerOptions& options, std::unique_ptr<SessionStore> sessions,
               std::unique_ptr<JobStore> jobs, std::unique_ptr<CalibrationStore> calibrations)
    : calibrations_(std::move(calibrations)),
      sessions_(std::move(sessions)),
      jobs_(std::move(jobs)),
      mattes_(options.data),
      solves_({.sessions = *sessions_, .jobs = *jobs_, .mattes = mattes_}, rig_, options.min_tile_seconds),
      tiles_({.sessions = *sessions_, .jobs = *jobs_, .mattes = mattes_}, rig_, solves_.progress(),
             options.lease),
      captures_(*sessions_, rig_, rig_lock_, *calibrations_, options.data),
      control_(*sessions_, captures_, solves_),
      importer_(*sessions_, rig_),
      replicator_(*sessions_, rig_),
      deleter_(*sessions_, rig_, mattes_,
               {.remove_job = [this](const v1::Session& session) { return solves_.remove(session); },
                .forget =
                    [this](const std::string& session) {
                      solves_.forget(session);
                      captures_.forget(session);
                    }}) {}

absl::Status Server::take_up() {
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> sessions, sessions_->all_stored());
  SessionStore::Edit edit = sessions_->edit();
  GW_RETURN_IF_ERROR(solves_.take_up(edit, sessions));
  return captures_.take_up(edit, sessions);
}

}  // namespace glasswing
