// Solves rows of a stack by swept stripes (Chuang et al. 2000, section 3), each pixel's channel by itself.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/gaussian/joint_batch.h"
#include "solver/gaussian/mode_search.h"
#include "solver/gaussian/sample_tile.h"
#include "solver/gaussian/stack_layout.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

class StackSolver {
 public:
  // Keeps references to stack and layout. `max_modes`: 1 to kMaxModes, per channel over all monitors.
  StackSolver(const FrameStack& stack, const StackLayout& layout, int max_modes, double silhouette_tolerance);

  // Solves row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  // One monitor's sweeps.
  struct Texture {
    int texture = 0;
    MonitorExtent extent;
    SampleLayout samples;
    std::vector<size_t> sweeps;  // indices in the layout, in the order of samples.sweeps
  };
  // The even samples in which a block's peaks are found, one grid per sweep of the layout.
  struct Grid {
    bool even = true;
    double step_px = 0.0;
    int count = 0;
    std::vector<float> samples;  // of uneven sweeps, interpolated linearly
  };

  // A block of the current tile.
  struct Block {
    int first_lane = 0;      // of the row
    unsigned lanes = 0;      // those to solve, a bit each
    unsigned saturated = 0;  // those with a saturated sample
    std::array<float, kBlockLanes> baseline{};
    std::vector<std::array<Peaks, kBlockLanes>> peaks;  // [sweep][lane]
  };

  void estimate_row_noise(int y);
  // noise_sd_ by pixel.
  std::vector<double> read_noise() const;
  // Scales the tile's samples to a stripe of peak 1, and computes their weights and peaks.
  void prepare_block(int y, int block);
  void weigh(int block, const float* inverse_peak);
  void find_peaks(int block, const std::array<float, kBlockLanes>& floor,
                  const std::array<float, kBlockLanes>& noise);
  // Fits, on one texture, all lanes of the tile that have as many footprints as peaks, batch by batch.
  void fit_usual(size_t texture);
  void solve_lane(int block, int lane, int y, Matte& matte);
  JointFit search(size_t texture, int block, int lane, double noise_sd, const JointFit* usual);
  int max_modes(int block, int lane) const;  // on each of the textures
  std::vector<Peaks> peaks_of(size_t texture, int block, int lane) const;
  bool has_samples(size_t texture, int block, int lane) const;  // any unsaturated sample

  const FrameStack& stack_;
  const StackLayout& layout_;
  const int max_modes_;
  const int lane_count_;  // of a row
  Surroundings surroundings_;
  const bool noise_known_;
  const bool coarse_;  // second differences of the samples contain more than noise
  const SampleNoise noise_;
  float dark_noise_ =
      1.0f;  // noise of a dark sample merged from all exposures, relative to the reference exposure
  std::vector<Texture> textures_;
  std::vector<Grid> grids_;
  SampleTile tile_;
  // Of the current row.
  std::vector<float> noise_sd_;  // a dark sample's, by lane
  std::vector<bool> to_solve_;   // by pixel
  // Of the current tile.
  bool unit_peaks_ = true;
  std::vector<float>
      inverse_peak_[kChannels];  // by the first lane's channel: [sample][lane], 0 for a dark one
  std::vector<Block> blocks_;
  PeakFinder finder_;
  std::vector<std::vector<std::optional<JointFit>>> usual_;  // [texture][lane of the tile]
  PixelSamples samples_;
  JointWorkspace workspace_;
};

}  // namespace glasswing
