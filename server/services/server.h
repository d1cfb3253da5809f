// The server's parts, put together.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/archives/importer.h"
#include "server/archives/replicator.h"
#include "server/archives/session_deleter.h"
#include "server/archives/storage_keeper.h"
#include "server/capture/capture_runner.h"
#include "server/dispatch/adaptive_rounds.h"
#include "server/dispatch/drafts.h"
#include "server/dispatch/tile_dispatcher.h"
#include "server/jobs/job_store.h"
#include "server/queue/capture_queue.h"
#include "server/rig/calibration_store.h"
#include "server/rig/node_registry.h"
#include "server/rig/rig_lock.h"
#include "server/services/session_control.h"
#include "server/sessions/session_store.h"
#include "server/solve/following_solves.h"
#include "server/solve/solve_runner.h"
#include "server/solve/tile_sizes.h"
#include "server/storage/image_files.h"
#include "server/storage/matte_files.h"
#include "server/storage/problems.h"

namespace glasswing {

struct ServerOptions {
  std::filesystem::path data;
  std::string jobs = {};     // connection string of a PostgreSQL; empty: SQLite below `data`
  std::string address = {};  // where solvers of other servers reach this one; empty: there are none
  std::chrono::milliseconds lease{10000};
  double min_tile_seconds = kMinTileSeconds;        // of work in a tile of rows
  std::chrono::milliseconds node_call = kNodeCall;  // until a call to a node is made again
  StorageOptions storage = {};
};

// Thread-safe.
class Server {
 public:
  // Opens the catalogue and the job store, and resumes the sessions that an earlier server left. Damaged
  // items are set aside, and reported by problems(); work that must wait for the job store continues once it
  // answers. DATA_LOSS: the catalogue as a whole is damaged.
  static absl::StatusOr<std::unique_ptr<Server>> open(const ServerOptions& options);

  Problems& problems() { return *stores_.problems; }
  NodeRegistry& rig() { return rig_; }
  RigLock& rig_lock() { return rig_lock_; }
  CalibrationStore& calibrations() { return *stores_.calibrations; }

  SessionStore& sessions() { return *stores_.sessions; }
  ImageFiles& images() { return *stores_.images; }
  CaptureRunner& captures() { return captures_; }
  CaptureQueue& queue() { return queue_; }
  SolveRunner& solves() { return solves_; }
  Drafts& drafts() { return drafts_; }
  TileDispatcher& tiles() { return tiles_; }
  JobStore& jobs() { return *stores_.jobs; }
  SessionControl& control() { return control_; }
  Importer& importer() { return importer_; }
  Replicator& replicator() { return replicator_; }
  SessionDeleter& deleter() { return deleter_; }
  StorageKeeper& storage() { return storage_; }

  // For monitoring.
  absl::StatusOr<v1::GetFleetResponse> fleet() { return tiles_.fleet(); }
  absl::StatusOr<std::vector<v1::Session>> list(const v1::ListSessionsRequest& request) {
    return stores_.sessions->list(request);
  }

 private:
  struct Stores {
    std::unique_ptr<Problems> problems;
    std::unique_ptr<CalibrationStore> calibrations;
    std::unique_ptr<SessionStore> sessions;
    std::unique_ptr<ImageFiles> images;
    std::unique_ptr<JobStore> jobs;
    std::unique_ptr<JobStore> drafts;
    std::unique_ptr<QueueStore> queue;
  };
  Server(const ServerOptions& options, NodeNames names, Stores stores);
  absl::Status take_up();
  // UNAVAILABLE: the job store does not answer.
  absl::Status take_up_solves();
  void take_up_solves_later(std::stop_token stop);

  NodeRegistry rig_;
  RigLock rig_lock_;
  const Stores stores_;
  const MatteFiles mattes_;
  SolveRunner solves_;
  FollowingSolves following_solves_;
  Drafts drafts_;
  AdaptiveRounds rounds_;
  TileDispatcher tiles_;
  CaptureRunner captures_;  // after what it uses: its end pauses a running capture
  CaptureQueue queue_;      // after captures_, so that it does not take that pause for a person's
  SessionControl control_;
  Importer importer_;
  Replicator replicator_;
  SessionDeleter deleter_;
  StorageKeeper storage_;
  std::jthread waiting_;  // for the job store, if it did not answer at the start
};

}  // namespace glasswing
