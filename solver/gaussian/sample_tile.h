// The samples of all sweeps for a stretch of one row, in blocks of kBlockLanes side by side: lane l of the
// stretch is one channel of one pixel, in the order of a frame's own samples.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "solver/background/silhouette.h"
#include "solver/gaussian/peaks.h"
#include "solver/gaussian/stack_layout.h"
#include "solver/method/method.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

class SampleTile {
 public:
  static constexpr int kMaxBlocks = 16;

  explicit SampleTile(const StackLayout& layout);

  // Reads lanes [first_lane, first_lane + lane_count) of a row; lane_count is at most kMaxBlocks *
  // kBlockLanes. Radiance on the scale of the reference exposure. Where several exposures were taken they are
  // merged (exposure_merge.h).
  void load(const FrameStack& stack, int row, int first_lane, int lane_count, const SampleNoise& noise);

  int block_count() const { return block_count_; }
  // One sweep of a block; the samples may be changed.
  float* samples(int block, size_t sweep) { return samples_.data() + place(block, sweep); }
  const float* samples(int block, size_t sweep) const { return samples_.data() + place(block, sweep); }
  // How many frames' worth of light a sample has: 0 saturated, 1 as one frame of the reference exposure; only
  // where there are several exposures or a saturated sample.
  const float* weights(int block, size_t sweep) const { return weights_.data() + place(block, sweep); }
  float* weights(int block, size_t sweep) { return weights_.data() + place(block, sweep); }
  bool weighted() const { return weighted_; }
  // Gives all samples weights, 1 if they have none.
  void need_weights();
  size_t sample_count() const { return sample_count_; }  // of all sweeps, one block's after another's

  // Of all samples of a lane that lie within `reach` of `middle`, and `middle` itself, the median.
  std::array<float, kBlockLanes> median_near(int block, const std::array<float, kBlockLanes>& middle,
                                             const std::array<float, kBlockLanes>& reach) const;

 private:
  size_t place(int block, size_t sweep) const {
    return (static_cast<size_t>(block) * sample_count_ + first_sample_[sweep]) * kBlockLanes;
  }
  void load_brackets(const FrameStack& stack, size_t row_start, int lane_count, const SampleNoise& noise);

  const StackLayout& layout_;
  size_t sample_count_ = 0;           // of all sweeps
  std::vector<size_t> first_sample_;  // by sweep
  int block_count_ = 0;
  bool weighted_ = false;
  std::vector<float> samples_, weights_;
};

}  // namespace glasswing
