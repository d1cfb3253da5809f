// Tiles: leased to solvers, and their results stored. What solvers call.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <optional>
#include <string>

#include "glasswing/v1/fleet_service.pb.h"
#include "glasswing/v1/work_service.pb.h"
#include "server/dispatch/drafts.h"
#include "server/dispatch/fleet.h"
#include "server/mattes/frame_mattes.h"
#include "server/mattes/received_matte.h"
#include "server/rig/node_registry.h"
#include "server/solve/solve_progress.h"
#include "server/solve/solve_session.h"

namespace glasswing {

// Thread-safe. Errors are those listed in work_service.proto.
class TileDispatcher {
 public:
  // `lease`: how long a tile of a solve is leased without renew().
  TileDispatcher(const SolveStores& stores, NodeRegistry& nodes, SolveProgress& progress, Drafts& drafts,
                 std::chrono::milliseconds lease)
      : stores_(stores), nodes_(nodes), progress_(progress), drafts_(drafts), lease_(lease) {}

  // A tile of a draft is returned only if no solve has one. Without a lease in the answer there is nothing to
  // do now.
  absl::StatusOr<v1::ClaimTileResponse> claim(const v1::ClaimTileRequest& request);
  // Returns when claim() may have a tile, or after `timeout`. A hint.
  void wait_for_tiles(std::chrono::milliseconds timeout) { stores_.jobs.wait_for_tiles(timeout); }
  absl::Status renew(const v1::TileLease& lease);
  // The destination of a video tile's files as they arrive; none for a tile of rows.
  absl::StatusOr<std::optional<FrameMattes>> frames_of(const v1::TileLease& lease);
  // The destination of the file of a tile of rows as it arrives.
  absl::StatusOr<ReceivedMatte> rows_of(const v1::TileLease& lease);
  absl::Status complete(const v1::CompleteTileRequest& header, ReceivedMatte matte);
  absl::Status complete(const v1::CompleteTileRequest& header, FrameMattes mattes);
  absl::Status fail(const v1::FailTileRequest& request);

  absl::StatusOr<v1::GetFleetResponse> fleet();

 private:
  absl::Status store_rows(const std::string& session, const std::string& file, ReceivedMatte& matte);
  // The attempt failed, because its result is not a matte. ABORTED, so that the solver gives up the tile.
  absl::Status spoiled(const v1::CompleteTileRequest& header, const absl::Status& why);
  absl::Status place_frames(const v1::CompleteTileRequest& header, FrameMattes& mattes);
  absl::Status done(const v1::CompleteTileRequest& header, const TileAttempt& attempt,
                    const std::string& result);
  // False: the solve does not continue.
  absl::StatusOr<bool> note_quarantined(const v1::FailTileRequest& request);

  const SolveStores stores_;
  NodeRegistry& nodes_;
  SolveProgress& progress_;
  Drafts& drafts_;
  const std::chrono::milliseconds lease_;
  Fleet fleet_;
};

// The answer to a claim, without the lease's duration and the replicas' addresses.
// DATA_LOSS: the job store's entry cannot be read.
absl::StatusOr<v1::ClaimTileResponse> claimed_tile(const Lease& lease);

}  // namespace glasswing
