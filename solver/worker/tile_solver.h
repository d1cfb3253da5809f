// What a solver makes of a tile that it was given: frames read from the nodes that hold them, solved, and
// encoded.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/archive/remote_archive.h"
#include "glasswing/v1/work_service.pb.h"
#include "solver/method/method.h"

namespace glasswing {

// What a tile became: the file of its rows, or a file for each of its frames.
struct SolvedFile {
  std::optional<int> frame;
  std::string bytes;
};
struct SolvedTile {
  std::int64_t object_pixel_count = 0, flagged_pixel_count = 0;
  std::vector<SolvedFile> files;
  std::vector<v1::RefusedFrame> refused;
};

// Rows of frames, and where they lie: to be asked whether they are intact() once they were solved.
struct ReadStack {
  FrameStack stack;
  FrameRows rows;
};

// The frames of one solve, and what is the same for all its tiles. Thread-safe.
class SolveSource {
 public:
  // Reads the manifest, and measures drift. Errors are those of RemoteArchive.
  static absl::StatusOr<std::shared_ptr<const SolveSource>> open(const v1::ClaimTileResponse& tile,
                                                                 std::stop_token stop);

  const RemoteArchive& archive() const { return archive_; }
  const v1::CaptureManifest& manifest() const { return manifest_; }
  // The rows that the method needs. FAILED_PRECONDITION says what the archive lacks.
  absl::StatusOr<ReadStack> stack(const Method& method, int first_row, int row_count) const;

 private:
  SolveSource(const v1::ClaimTileResponse& tile, std::stop_token stop);

  RemoteArchive archive_;
  v1::CaptureManifest manifest_;
  std::vector<float> brightness_;
};

// A tile between its parts: what was read of it, to be solved. Of frames nothing yet: they are read as they
// are solved.
class TileInHand {
 public:
  static absl::StatusOr<TileInHand> read(const v1::ClaimTileResponse& tile,
                                         std::shared_ptr<const SolveSource> source);
  // CANCELLED once `stop` was asked for.
  absl::StatusOr<SolvedTile> solve(int thread_count, std::stop_token stop) const;

 private:
  v1::ClaimTileResponse tile_;
  std::shared_ptr<const SolveSource> source_;
  std::shared_ptr<const Method> method_;  // null: of frames
  ReadStack read_;
};

// Seconds that each of the survey's rows takes all threads together.
absl::StatusOr<std::vector<double>> survey(const v1::ClaimTileResponse& tile, const SolveSource& source,
                                           int thread_count, std::stop_token stop);

}  // namespace glasswing
