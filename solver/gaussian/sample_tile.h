// The samples of all sweeps for a stretch of one row, in blocks of kBlockLanes adjacent: lane l of the
// stretch is one channel of one pixel (the one of a mosaic), in the order of a frame's own samples.
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

  // Reads lanes [first_lane, first_lane + lane_count) of a row as radiance at the reference exposure;
  // lane_count is at most kMaxBlocks * kBlockLanes. Several exposures are merged (exposure_merge.h).
  void load(const FrameStack& stack, int row, int first_lane, int lane_count, const SampleNoise& noise);

  int block_count() const { return block_count_; }
  // One sweep of a block; samples may be modified.
  float* samples(int block, size_t sweep) { return samples_.data() + place(block, sweep); }
  const float* samples(int block, size_t sweep) const { return samples_.data() + place(block, sweep); }
  // A sample's weight in frames of the reference exposure; negative if saturated, when the sample is a lower
  // bound that counts with this weight where a model is below it. Only if weighted(): with several
  // exposures or a saturated sample.
  const float* weights(int block, size_t sweep) const { return weights_.data() + place(block, sweep); }
  float* weights(int block, size_t sweep) { return weights_.data() + place(block, sweep); }
  bool weighted() const { return weighted_; }
  // Makes weighted() true; samples without weights get 1.
  void need_weights();
  // White and bars of one monitor: [area][lane], in the layout's order. The variance is infinite where every
  // exposure is saturated, negative where the camera clipped the light. `one`: the variance of one exposure;
  // 0: that of the noise model.
  const float* areas(int block, size_t texture) const { return areas_.data() + area_place(block, texture); }
  const float* area_variances(int block, size_t texture) const {
    return area_variances_.data() + area_place(block, texture);
  }
  void load_areas(const FrameStack& stack, int row, int block, int first_lane, int lane_count,
                  const SampleNoise& noise, const std::array<float, kBlockLanes>& one,
                  const std::array<bool, kBlockLanes>& clipped);
  // The share of a lane's samples that the camera clipped, unless they are adjacent.
  std::array<float, kBlockLanes> cut_off(int block) const;
  // Replaces these, if noise of this sd makes them darker than black on average, by its effect on the light
  // of their neighbours: then dark samples are right on average (clipped_noise.h).
  void replace_cut_off(int block, const std::array<float, kBlockLanes>& noise_sd);

  size_t sample_count() const { return sample_count_; }  // of all sweeps of one block

  // The median of `middle` and all samples of a lane within `reach` of it.
  std::array<float, kBlockLanes> median_near(int block, const std::array<float, kBlockLanes>& middle,
                                             const std::array<float, kBlockLanes>& reach) const;

 private:
  size_t place(int block, size_t sweep) const {
    return (static_cast<size_t>(block) * sample_count_ + first_sample_[sweep]) * kBlockLanes;
  }
  size_t area_place(int block, size_t texture) const {
    return (static_cast<size_t>(block) * area_count_ + first_area_[texture]) * kBlockLanes;
  }
  void load_brackets(const FrameStack& stack, size_t row_start, int lane_count, const SampleNoise& noise);

  const StackLayout& layout_;
  size_t sample_count_ = 0;           // of all sweeps
  std::vector<size_t> first_sample_;  // by sweep
  int block_count_ = 0;
  size_t area_count_ = 0;           // of all monitors
  std::vector<size_t> first_area_;  // by texture
  bool weighted_ = false;
  float cut_off_ = 0.0f;
  std::vector<float> samples_, weights_, areas_, area_variances_;
};

}  // namespace glasswing
