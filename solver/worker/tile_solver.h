// Solves a claimed tile: reads frames from the nodes that hold them, solves and encodes them.
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
#include "solver/worker/parallel_solve.h"

namespace glasswing {

// One file of the tile's rows, or one for each of its frames.
struct SolvedFile {
  std::optional<int> frame;
  std::string bytes;
};
struct SolvedTile {
  PixelCount pixels;
  std::vector<SolvedFile> files;
  std::vector<v1::RefusedFrame> refused;
};

// `rows` says after solving whether the samples were intact().
struct ReadStack {
  FrameStack stack;
  FrameRows rows;
};

// Leaves only the frames of these steps. FAILED_PRECONDITION: not every step has one.
absl::Status keep_steps(const google::protobuf::RepeatedField<std::int32_t>& rising,
                        v1::CaptureManifest& manifest);

// The archive of one solve job and everything that its tiles share. Thread-safe.
class SolveSource {
 public:
  // Reads the manifest, of a draft the part that it is made of, measures the brightness drift and lays out
  // the method. INVALID_ARGUMENT: a method, an option or a calibration. FAILED_PRECONDITION says what the
  // archive lacks. Other errors are RemoteArchive's.
  static absl::StatusOr<std::shared_ptr<const SolveSource>> open(const v1::ClaimTileResponse& tile,
                                                                 std::stop_token stop);

  const RemoteArchive& archive() const { return archive_; }
  const v1::CaptureManifest& manifest() const { return manifest_; }
  // Null for a video, whose frames are solved one by one.
  const PreparedSolve* prepared() const { return prepared_ ? &*prepared_ : nullptr; }
  // The rows that the method needs; not for a video.
  absl::StatusOr<ReadStack> stack(int first_row, int row_count) const;

 private:
  SolveSource(const v1::ClaimTileResponse& tile, std::stop_token stop);

  RemoteArchive archive_;
  v1::CaptureManifest manifest_;
  std::vector<std::array<float, 3>> brightness_;
  std::optional<PreparedSolve> prepared_;
};

// A tile whose rows have been read. A video's frames are read later, while they are solved.
class TileInHand {
 public:
  static absl::StatusOr<TileInHand> read(const v1::ClaimTileResponse& tile,
                                         std::shared_ptr<const SolveSource> source);
  // CANCELLED once `stop` is requested.
  absl::StatusOr<SolvedTile> solve(int thread_count, std::stop_token stop) const;

 private:
  v1::ClaimTileResponse tile_;
  std::shared_ptr<const SolveSource> source_;
  ReadStack read_;  // empty for a video
};

// The seconds that each of the survey's rows takes on all threads together.
absl::StatusOr<std::vector<double>> survey(const v1::ClaimTileResponse& tile, const SolveSource& source,
                                           int thread_count, std::stop_token stop);

}  // namespace glasswing
