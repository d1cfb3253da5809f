// Solves rows of a stack by swept stripes (Chuang et al. 2000, section 3), each pixel's channel by itself.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/gaussian/broad_light.h"
#include "solver/gaussian/joint_batch.h"
#include "solver/gaussian/mode_search.h"
#include "solver/gaussian/sample_tile.h"
#include "solver/gaussian/stack_layout.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

// One monitor's sweeps: what all tiles share.
struct SweptMonitor {
  int texture = 0;
  MonitorExtent extent;
  SampleLayout samples;
  std::vector<size_t> sweeps;                      // indices in the layout, in the order of samples.sweeps
  std::vector<LitArea> areas;                      // in the order of the layout's
  std::optional<BroadLight> broad = std::nullopt;  // if there are areas
};
std::vector<SweptMonitor> swept_monitors(const StackLayout& layout);

class StackSolver {
 public:
  // Keeps references to stack, layout and monitors, which are swept_monitors(layout). `max_modes`: 1 to
  // kMaxFootprints, per channel and monitor.
  StackSolver(const FrameStack& stack, const StackLayout& layout, const std::vector<SweptMonitor>& monitors,
              int max_modes, double silhouette_tolerance);

  // Solves row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  // Of a lane, on one monitor.
  struct Settled {
    JointFit fit;  // its floor is above black
    // White's light, and what it has beyond fit and floor, per light of 1; by all pictures of white and bars
    // together.
    bool white_known = false;
    double white = 0.0, rest = 0.0, rest_variance = 0.0;
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
    int first_lane = 0;                       // of the row
    int phase = 0;                            // which channels its lanes are of
    unsigned lanes = 0;                       // those to solve, a bit each
    unsigned saturated = 0;                   // those with a saturated sample
    std::array<bool, kBlockLanes> clipped{};  // noise made samples darker than black
    std::array<float, kBlockLanes> baseline{};
    std::vector<std::array<Peaks, kBlockLanes>> peaks;  // [sweep][lane]
  };

  // A block's lanes begin with any channel; on a mosaic, where blocks begin at even columns, they depend on
  // the row.
  int phase_of(int first_lane, int y) const;
  int channel_in(int phase, int lane) const;
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
  // The fit of a lane's sweeps, held against white and bars.
  Settled fit_sweeps(size_t texture, int block, int lane, int y);
  // Fits sweeps, white and bars together.
  void settle(size_t texture, int block, int lane, int y, bool broad_light_expected, Settled& settled);
  // Fits samples_, whose areas are weighed anew as the modes change; none without a sound minimum.
  std::optional<JointFit> fit_all(size_t texture, int block, int lane, int y, const Footprints& start);
  // Sets what white and bars of samples_ have beyond the fit.
  void hold_against_white(size_t texture, double noise_sd, Settled& settled) const;
  // Whether what white has beyond the fits of a lane and its neighbours along the row is more than noise.
  bool neighbours_have_more(size_t texture, size_t lane) const;
  // The fit with broad light, if white shows more than the modes and there is any.
  std::optional<JointFit> with_broad_light(size_t texture, int block, int lane, int y, bool expected,
                                           const Settled& settled);
  // Writes a lane's fits into the matte.
  void store(int block, int lane, int y, Matte& matte) const;
  // Sets samples_ to those of a lane's sweeps, above the baseline.
  void load_samples(size_t texture, int block, int lane);
  // Takes the baseline back from samples_: they are above black then, with a floor.
  void free_floor(int block, int lane, int y);
  // Adds white and bars, above black. They count less where they may show that the modes are not quite
  // Gaussian; where noise made them darker than black, the fit says by how much in the mean.
  void load_areas(size_t texture, int block, int lane, int y, const JointFit& fit);
  std::vector<Peaks> peaks_of(size_t texture, int block, int lane) const;
  bool has_samples(size_t texture, int block, int lane) const;  // any unsaturated sample

  const FrameStack& stack_;
  const StackLayout& layout_;
  const int max_modes_;
  const int pixel_lanes_;  // of a pixel: its channels, or the one that a mosaic's photosite measured
  const int lane_count_;   // of a row
  Surroundings surroundings_;
  const bool noise_known_;
  const bool coarse_;  // second differences of the samples contain more than noise
  const SampleNoise noise_;
  float dark_noise_ =
      1.0f;  // noise of a dark sample merged from all exposures, relative to the reference exposure
  const std::vector<SweptMonitor>& textures_;
  std::vector<Grid> grids_;
  SampleTile tile_;
  // Of the current row.
  std::vector<float> noise_sd_;   // a dark sample's, by lane
  std::vector<float> unclipped_;  // noise_sd_ over what is left of it where samples are cut off at 0
  std::vector<bool> to_solve_;    // by pixel
  // Of the current tile.
  bool unit_peaks_ = true;
  std::vector<float> inverse_peak_[kChannels];  // by phase: [sample][lane], 0 for a dark one
  std::vector<Block> blocks_;
  PeakFinder finder_;
  std::vector<std::vector<std::optional<JointFit>>> usual_;  // [texture][lane of the tile]
  std::vector<std::vector<Settled>> settled_;                // [texture][lane of the tile]
  std::vector<bool> neighbours_have_more_;                   // by lane of the tile
  PixelSamples samples_, rest_, averaged_;
  JointWorkspace workspace_;
};

}  // namespace glasswing
