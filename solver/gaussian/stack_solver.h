// Solves rows of a stack by swept stripes (Chuang et al. 2000, section 3), each pixel's channel by itself:
// prepare (prepared_block.h), fit (joint_batch.h), judge what that does not explain (lane_solver.h), write.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/gaussian/lane_solver.h"
#include "solver/gaussian/prepared_block.h"

namespace glasswing {

class StackSolver {
 public:
  // Keeps references to stack, layout and monitors, which are swept_monitors(layout). `max_modes`: 1 to
  // kMaxFootprints, per channel and monitor.
  StackSolver(const FrameStack& stack, const StackLayout& layout, const std::vector<SweptMonitor>& monitors,
              int max_modes, double silhouette_tolerance);

  // Solves row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

  // What a lane of row y shows on each monitor, and how it is solved, for people. `lane`: of the row. Empty
  // where the object does not change the pixel.
  struct Explained {
    int channel = 0;
    std::vector<LaneSamples> samples;  // by monitor
    std::vector<LaneFit> fits;
    std::vector<LaneNotes> notes;
  };
  std::vector<Explained> explain(int x, int y);

 private:
  // Of the lanes of a tile.
  struct Tile {
    std::vector<PreparedBlock> blocks;
    std::vector<std::vector<BatchFit>> batch;  // [monitor][lane]
    std::vector<std::vector<bool>> batched;    // whether the batch holds it
    std::vector<std::vector<LaneFit>> fits;
  };
  static size_t place(int block, int lane) { return static_cast<size_t>(block) * kBlockLanes + lane; }

  // A block's lanes begin with any channel; on a mosaic, where blocks begin at even columns, they depend on
  // the row.
  int phase_of(int first_lane, int y) const;
  int channel_in(int phase, int lane) const;
  // Sets noise_sd_ and to_solve_; the matte of pixels that the object does not change.
  void settle_row(int y, Matte& matte);
  void estimate_row_noise(int y);
  // noise_sd_ by pixel.
  std::vector<double> read_noise() const;
  Tile prepare(int y, int first, int count);
  void fit_batches(size_t monitor, Tile& tile) const;
  BatchPixel batch_pixel(size_t monitor, const Tile& tile, int block, int lane) const;
  LaneSamples lane_samples(size_t monitor, const PreparedBlock& block, int block_index, int lane) const;
  // Fits of what the batch does not explain.
  void fit_lanes(size_t monitor, Tile& tile);
  // Whether what white has beyond the fits of a lane and its neighbours along the row is more than noise.
  bool neighbours_have_more(const std::vector<WhiteRest>& beyond, size_t lane) const;
  // Writes a lane's fits into the matte.
  void store(const Tile& tile, int block, int lane, int y, Matte& matte) const;
  bool has_samples(size_t monitor, int block, int lane) const;  // any unsaturated sample

  const FrameStack& stack_;
  const StackLayout& layout_;
  const std::vector<SweptMonitor>& monitors_;
  const int max_modes_;
  const int pixel_lanes_;  // of a pixel: its channels, or the one that a mosaic's photosite measured
  const int lane_count_;   // of a row
  Surroundings surroundings_;
  const bool noise_known_;
  const bool coarse_;  // second differences of the samples contain more than noise
  const SampleNoise noise_;
  SampleTile tile_;
  BlockPreparer preparer_;
  std::vector<LaneSolver> lane_solvers_;  // by monitor
  // Of the current row.
  std::vector<float> noise_sd_;  // a dark sample's, by lane
  std::vector<bool> to_solve_;   // by pixel
};

}  // namespace glasswing
