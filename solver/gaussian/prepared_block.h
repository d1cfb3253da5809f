// Samples ready to be fitted: of kBlockLanes lanes side by side, above a baseline, weighted by their noise,
// with the peaks of their sweeps. A lane is one channel of one pixel.
#pragma once

#include <array>
#include <vector>

#include "solver/gaussian/peaks.h"
#include "solver/gaussian/sample_tile.h"
#include "solver/gaussian/swept_monitor.h"

namespace glasswing {

struct PreparedBlock {
  using Lanes = std::array<float, kBlockLanes>;
  // F, as far as it is determined by sums over all samples of one monitor: of w u^2 and w u y (joint_fit.h).
  struct FloorSums {
    Lanes squares{}, products{};
  };

  int first_lane = 0;                                 // of the row
  int phase = 0;                                      // which channels its lanes are of
  unsigned lanes = 0;                                 // those to solve, a bit each
  unsigned bounded = 0;                               // those with a saturated sample
  std::array<bool, kBlockLanes> clipped{};            // the camera cut off noise
  Lanes noise_sd{};                                   // of a sample of weight 1
  Lanes black{}, baseline{};                          // radiance of the black frame, and without stripes
  std::vector<FloorSums> floor;                       // [monitor]
  std::vector<std::array<Peaks, kBlockLanes>> peaks;  // [sweep][lane]

  bool solves(int lane) const { return (lanes >> lane & 1u) != 0; }
  bool is_bounded(int lane) const { return (bounded >> lane & 1u) != 0; }
};

// What is known of a block's lanes before their samples are examined.
struct BlockStart {
  int first_lane = 0, phase = 0;
  unsigned lanes = 0;
  PreparedBlock::Lanes noise_sd{}, black{};
};

// Prepares blocks of one layout. Not thread-safe: it has scratch memory.
class BlockPreparer {
 public:
  // `noise`: of the camera; `known`: not measured from the samples. Keeps references to the first two.
  // `channel_in`: of a phase's lane.
  template <typename ChannelIn>
  BlockPreparer(const StackLayout& layout, const std::vector<SweptMonitor>& monitors,
                const SampleNoise& noise, bool known, ChannelIn channel_in)
      : BlockPreparer(layout, monitors, noise, known) {
    for (int phase = 0; phase < kChannels; ++phase) {
      for (int lane = 0; lane < kBlockLanes; ++lane) channels_[phase][lane] = channel_in(phase, lane);
    }
    find_inverse_peaks();
  }

  // Whether samples need weights: where noise grows with light, or stripes differ in brightness.
  bool needs_weights() const { return noise_.gain > 0.0 || !unit_peaks_; }
  // Of a merged dark sample, relative to one of the reference exposure.
  float dark_noise() const { return dark_noise_; }

  // Scales the block's samples in the tile, and replaces those that the camera clipped.
  PreparedBlock prepare(const BlockStart& start, SampleTile& tile, int block);

  // u of samples of a phase's first lane, [sample][lane]; like SampleTile's samples.
  const float* inverse_peak(int phase) const { return inverse_peak_[phase].data(); }
  bool unit_peaks() const { return unit_peaks_; }

 private:
  // The even samples in which a block's peaks are found, one grid per sweep of the layout.
  struct Grid {
    bool even = true;
    double step_px = 0.0;
    int count = 0;
    std::vector<float> samples;  // of uneven sweeps, interpolated linearly
  };

  BlockPreparer(const StackLayout& layout, const std::vector<SweptMonitor>& monitors,
                const SampleNoise& noise, bool known);
  void find_inverse_peaks();
  void replace_cut_off(PreparedBlock& own, SampleTile& tile, int block) const;
  // Returns the highest sample of each lane.
  PreparedBlock::Lanes scale(PreparedBlock& own, SampleTile& tile, int block) const;
  void find_peaks(const PreparedBlock::Lanes& highest, PreparedBlock& own, SampleTile& tile, int block);

  const StackLayout& layout_;
  const std::vector<SweptMonitor>& monitors_;
  const SampleNoise noise_;
  const bool known_;
  float dark_noise_ = 1.0f;
  bool unit_peaks_ = true;
  int channels_[kChannels][kBlockLanes];
  std::vector<float> inverse_peak_[kChannels];  // by phase: [sample][lane], 0 for a dark one
  std::vector<Grid> grids_;
  PeakFinder finder_;
};

}  // namespace glasswing
