// The server's parts, put together.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "server/archives/importer.h"
#include "server/archives/replicator.h"
#include "server/archives/session_deleter.h"
#include "server/capture/capture_runner.h"
#include "server/jobs/job_store.h"
#include "server/rig/calibration_store.h"
#include "server/rig/node_registry.h"
#include "server/rig/rig_lock.h"
#include "server/services/session_control.h"
#include "server/sessions/session_store.h"
#include "server/solve/solve_runner.h"
#include "server/solve/tile_dispatcher.h"
#include "server/solve/tile_sizes.h"
#include "server/storage/matte_files.h"

namespace glasswing {

struct ServerOptions {
  std::filesystem::path data;
  std::string jobs = {};     // connection string of a PostgreSQL; empty: SQLite below `data`
  std::string address = {};  // where solvers of other servers reach this one; empty: there are none
  std::chrono::milliseconds lease{10000};
  double min_tile_seconds = kMinTileSeconds;  // of work in a tile of rows
};

// Thread-safe.
class Server {
 public:
  // Opens the catalogue and the job store, and takes up the sessions that an earlier server left. UNAVAILABLE
  // or DATA_LOSS name what cannot be opened.
  static absl::StatusOr<std::unique_ptr<Server>> open(const ServerOptions& options);

  NodeRegistry& rig() { return rig_; }
  RigLock& rig_lock() { return rig_lock_; }
  CalibrationStore& calibrations() { return *calibrations_; }

  SessionStore& sessions() { return *sessions_; }
  CaptureRunner& captures() { return captures_; }
  SolveRunner& solves() { return solves_; }
  TileDispatcher& tiles() { return tiles_; }
  SessionControl& control() { return control_; }
  Importer& importer() { return importer_; }
  Replicator& replicator() { return replicator_; }
  SessionDeleter& deleter() { return deleter_; }

  // For monitoring.
  absl::StatusOr<v1::GetFleetResponse> fleet() { return tiles_.fleet(); }
  absl::StatusOr<std::vector<v1::Session>> list(const v1::ListSessionsRequest& request) {
    return sessions_->list(request);
  }

 private:
  Server(const ServerOptions& options, std::unique_ptr<SessionStore> sessions, std::unique_ptr<JobStore> jobs,
         std::unique_ptr<CalibrationStore> calibrations);
  absl::Status take_up();

  NodeRegistry rig_;
  RigLock rig_lock_;
  const std::unique_ptr<CalibrationStore> calibrations_;
  const std::unique_ptr<SessionStore> sessions_;
  const std::unique_ptr<JobStore> jobs_;
  const MatteFiles mattes_;
  SolveRunner solves_;
  TileDispatcher tiles_;
  CaptureRunner captures_;  // after what it uses: its end pauses a running capture
  SessionControl control_;
  Importer importer_;
  Replicator replicator_;
  SessionDeleter deleter_;
};

}  // namespace glasswing
