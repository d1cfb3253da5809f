#include "server/services/server.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/file/file.h"
#include "core/process/pause.h"
#include "server/jobs/timed_job_store.h"
#include "server/queue/queue_wish.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// The job store's name for this server, which stays the same when its address changes.
absl::StatusOr<std::string> server_id(const fs::path& data, Problems& problems) {
  const fs::path path = data / "server-id";
  if (fs::exists(path)) {
    GW_ASSIGN_OR_RETURN(std::string id, read_file(path));
    if (id.size() == 32 && id.find_first_not_of("0123456789abcdef") == std::string::npos) return id;
    GW_RETURN_IF_ERROR(problems.set_aside(
        data, path, absl::DataLossError("it does not contain 32 hexadecimal digits"),
        "a job store that several servers share does not recognise this server: its solves in progress there "
        "must be requested again"));
  }
  std::string id = random_token();
  GW_RETURN_IF_ERROR(write_file_durably(path, id));
  return id;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Server>> Server::open(const ServerOptions& options) {
  const fs::path& data = options.data;
  for (const char* name : {"mattes", "tiles"}) GW_RETURN_IF_ERROR(make_directory_durably(data / name));
  Stores stores;
  stores.problems = std::make_unique<Problems>();
  stores.problems->note_set_aside(data);
  GW_ASSIGN_OR_RETURN(stores.sessions, SessionStore::open(data));
  GW_ASSIGN_OR_RETURN(stores.calibrations, CalibrationStore::open(data, *stores.problems));
  GW_ASSIGN_OR_RETURN(stores.queue, QueueStore::open(data, *stores.problems));
  std::optional<std::set<std::string>> images = stores.sessions->photos();
  for (const v1::QueueItem& item : stores.queue->items()) {
    if (images) images->merge(images_of(item.wish()));
  }
  GW_ASSIGN_OR_RETURN(stores.images, ImageFiles::open(data / "images", images));
  GW_ASSIGN_OR_RETURN(NodeNames names, NodeNames::open(data, *stores.problems));
  GW_ASSIGN_OR_RETURN(const std::string id, server_id(data, *stores.problems));
  GW_ASSIGN_OR_RETURN(
      std::unique_ptr<JobStore> jobs,
      open_job_store(options.jobs, data,
                     {.server_id = id, .server_address = options.address, .lease = options.lease},
                     *stores.problems));
  stores.jobs = timed(std::move(jobs), *stores.problems);
  GW_ASSIGN_OR_RETURN(stores.drafts, open_job_store_in_memory({.server_id = id,
                                                               .server_address = {},
                                                               .lease = kDraftLease,
                                                               .least_before_twice = std::chrono::hours(1)}));
  std::unique_ptr<Server> server(new Server(options, std::move(names), std::move(stores)));
  GW_RETURN_IF_ERROR(server->take_up());
  return server;
}

Server::Server(const ServerOptions& options, NodeNames names, Stores stores)
    : rig_(std::move(names)),
      stores_(std::move(stores)),
      mattes_(options.data),
      solves_({.sessions = *stores_.sessions, .jobs = *stores_.jobs, .mattes = mattes_}, rig_,
              options.min_tile_seconds),
      following_solves_(*stores_.sessions, solves_),
      drafts_(*stores_.sessions, mattes_, *stores_.drafts),
      rounds_(drafts_, mattes_),
      tiles_({.sessions = *stores_.sessions, .jobs = *stores_.jobs, .mattes = mattes_}, rig_,
             solves_.progress(), drafts_, options.lease),
      captures_(
          *stores_.sessions, rig_, rig_lock_, *stores_.calibrations, *stores_.images,
          [this](std::vector<v1::Session> sessions, std::stop_token stop) {
            return rounds_.grow(std::move(sessions), std::move(stop));
          },
          [this](const v1::Session& session) { drafts_.note(session); },
          [this](const std::string& session) { following_solves_.look(session); }),
      queue_(*stores_.queue, {.sessions = *stores_.sessions,
                              .captures = captures_,
                              .rig_lock = rig_lock_,
                              .nodes = rig_,
                              .calibrations = *stores_.calibrations,
                              .images = *stores_.images,
                              .mattes = mattes_,
                              .jobs = *stores_.jobs}),
      control_(*stores_.sessions, captures_, solves_),
      importer_(*stores_.sessions, rig_),
      replicator_(*stores_.sessions, rig_),
      deleter_(*stores_.sessions, rig_, mattes_,
               {.give_up_solve =
                    [this](SessionStore::Edit& edit, v1::Session session) {
                      return solves_.cancel(edit, std::move(session), "");
                    },
                .remove_job = [this](const v1::Session& session) { return solves_.remove(session); },
                .forget =
                    [this](const v1::Session& session) {
                      solves_.forget(session.name());
                      drafts_.forget(session.name());
                      captures_.forget(session);
                    }}),
      storage_(*stores_.sessions, rig_, mattes_, deleter_, options.storage) {
  rig_.set_call_time(options.node_call);
  stores_.images->used_also_by([this] { return queue_.images(); });
}

absl::Status Server::take_up() {
  {
    SessionStore::Edit edit = sessions().edit();
    GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> all, sessions().all_stored());
    captures_.take_up(edit, all);
    following_solves_.take_up(all);
    drafts_.take_up();
  }
  queue_.start();
  storage_.start();
  const absl::Status taken = take_up_solves();
  if (!absl::IsUnavailable(taken)) return taken;
  waiting_ = std::jthread([this](std::stop_token stop) { take_up_solves_later(stop); });
  return absl::OkStatus();
}

absl::Status Server::take_up_solves() {
  // Asked first without an Edit, since an unavailable store may answer late.
  const absl::Status answers = stores_.jobs->own_jobs().status();
  SessionStore::Edit edit = sessions().edit();
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Session> all, sessions().all_stored());
  const absl::Status taken = answers.ok() ? solves_.take_up(edit, all, problems()) : answers;
  if (absl::IsUnavailable(taken)) solves_.wait_for_store(edit, all, taken);
  return taken;
}

void Server::take_up_solves_later(std::stop_token stop) {
  while (pause(stop, std::chrono::seconds(1))) {
    const absl::Status taken = take_up_solves();
    if (absl::IsUnavailable(taken)) continue;
    if (taken.ok()) spdlog::info("{} answers; solves go on", stores_.jobs->title());
    if (!taken.ok()) problems().set(kJobStore, std::string(taken.message()));
    return;
  }
}

}  // namespace glasswing
