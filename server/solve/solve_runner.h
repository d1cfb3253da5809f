// The server's solves: sessions cut into tiles for the solvers, from the request to the matte that can be
// fetched.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "core/matte/matte_region.h"
#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/matte_service.pb.h"
#include "glasswing/v1/session_service.pb.h"
#include "glasswing/v1/work_service.pb.h"
#include "server/mattes/received_matte.h"
#include "server/mattes/stored_matte.h"
#include "server/mattes/verified_mattes.h"
#include "server/rig/node_registry.h"
#include "server/solve/matte_assembly.h"
#include "server/solve/solve_clock.h"
#include "server/solve/solve_progress.h"
#include "server/solve/solve_session.h"
#include "server/storage/problems.h"

namespace glasswing {

// Thread-safe. Errors are those listed in session_service.proto and work_service.proto.
class SolveRunner {
 public:
  // `min_tile_seconds`: minimum work in a tile of rows.
  SolveRunner(const SolveStores& stores, const NodeRegistry& nodes, double min_tile_seconds)
      : stores_(stores), nodes_(nodes), min_tile_seconds_(min_tile_seconds) {}

  // Continues where an earlier server ended: solves continue, finished mattes are put in place, and jobs
  // without a session are removed. `sessions` is the whole catalogue. A failure for one session is reported
  // in `problems`, and the others continue. UNAVAILABLE: the job store does not answer; call again.
  absl::Status take_up(SessionStore::Edit& edit, std::span<const v1::Session> sessions, Problems& problems);
  // Until then solves wait for it.
  void wait_for_store(SessionStore::Edit& edit, std::span<const v1::Session> sessions,
                      const absl::Status& away);

  absl::StatusOr<v1::Session> solve(const v1::SolveSessionRequest& request);
  absl::Status complete_survey(const v1::CompleteSurveyRequest& request);

  // For a matte solved without tiles: the destination of its file as it arrives, and the session. Errors are
  // those listed in matte_service.proto.
  absl::StatusOr<ReceivedMatte> begin_put(const v1::PutMatteRequest& header);
  absl::StatusOr<v1::Session> put(const v1::PutMatteRequest& header, ReceivedMatte matte);

  // The session is being solved, or its solve is paused or failed (session_state.h). All return its new
  // record: cancel() that of its earlier solve, if one finished, or else that of its capture, with `reason`
  // saying why the solve gave no result.
  absl::StatusOr<v1::Session> pause(SessionStore::Edit& edit, v1::Session session);
  absl::StatusOr<v1::Session> resume(SessionStore::Edit& edit, v1::Session session);
  absl::StatusOr<v1::Session> cancel(SessionStore::Edit& edit, v1::Session session,
                                     const std::string& reason);

  // Path of the last finished solve's matte, or of a video frame's. The file may be replaced before it is
  // read: then call again.
  absl::StatusOr<std::filesystem::path> matte(const std::string& name, std::optional<int> frame);
  // Its verified file, or a file with that part of it. DATA_LOSS names the file, and what to do.
  // INVALID_ARGUMENT: the region is not within the picture.
  absl::StatusOr<StoredMatte> open_matte(const std::string& name, std::optional<int> frame,
                                         const MattePart& part);
  // For a finished solve, the same. Otherwise: for an interrupted solve the tiles so far, or else the newest
  // draft; without a draft, for a running solve, the tiles so far. FAILED_PRECONDITION: there is no draft,
  // and no tile is done.
  absl::StatusOr<StoredMatte> open_partial_matte(const std::string& name, const MattePart& part);

  // Removes the job of a session that is being deleted.
  absl::Status remove(const v1::Session& session);
  void forget(const std::string& session) { progress_.forget(session); }

  SolveProgress& progress() { return progress_; }

 private:
  absl::Status take_up(SessionStore::Edit& edit, const v1::Session& session);
  absl::Status take_up_solve(SessionStore::Edit& edit, v1::Session session);
  absl::Status take_up_matte(SessionStore::Edit& edit, v1::Session session);
  absl::StatusOr<v1::Session> begin(SessionStore::Edit& edit, v1::Session session,
                                    const v1::CaptureManifest& manifest);
  absl::StatusOr<StoredMatte> open_file(const std::filesystem::path& path, const MattePart& part);
  absl::StatusOr<StoredMatte> part_of(const PositionedFile& file, const MattePart& part) const;

  const SolveStores stores_;
  const NodeRegistry& nodes_;
  const double min_tile_seconds_;
  SolveClock clock_;
  MatteAssembly assembly_{stores_, clock_};
  SolveProgress progress_{stores_, clock_, assembly_};
  VerifiedMattes verified_;
};

}  // namespace glasswing
