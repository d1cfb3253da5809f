#include "solver/gaussian/sample_tile.h"

#include <algorithm>

#include "solver/gaussian/sample_kernel.h"
#include "solver/method/clipped_noise.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {

SampleTile::SampleTile(const StackLayout& layout) : layout_(layout) {
  for (const SweepLayout& sweep : layout.sweeps) {
    first_sample_.push_back(sample_count_);
    sample_count_ += sweep.shots.size();
  }
  samples_.resize(sample_count_ * kBlockLanes * kMaxBlocks);
  for (const std::vector<AreaFrames>& areas : layout.areas) {
    first_area_.push_back(area_count_);
    area_count_ += areas.size();
  }
  areas_.resize(area_count_ * kBlockLanes * kMaxBlocks);
  area_variances_.resize(areas_.size());
}

void SampleTile::load(const FrameStack& stack, int row, int first_lane, int lane_count,
                      const SampleNoise& noise) {
  block_count_ = (lane_count + kBlockLanes - 1) / kBlockLanes;
  const size_t start = stack.sample_index(0, row, 0) + static_cast<size_t>(first_lane);
  weighted_ = false;
  cut_off_ = stack.cut_off;
  if (!layout_.one_frame_a_shot) {
    load_brackets(stack, start, lane_count, noise);
    return;
  }
  std::uint16_t highest = 0;
  size_t sample = 0;
  for (const SweepLayout& sweep : layout_.sweeps) {
    for (const Shot& shot : sweep.shots) {
      const std::uint16_t* codes = stack.rows[shot.front().frame].data() + start;
      // Prefetch the next stretch: frames lie too far apart for the hardware prefetcher.
      for (int ahead = lane_count; ahead < 2 * lane_count; ahead += 32) __builtin_prefetch(codes + ahead);
      const std::uint16_t most =
          internal::load_frame(codes, lane_count, stack.zero, stack.unit,
                               samples_.data() + sample * kBlockLanes, sample_count_ * kBlockLanes);
      highest = std::max(highest, most);
      ++sample;
    }
  }
  if (highest < kSaturatedCode) return;
  weighted_ = true;
  weights_.resize(samples_.size());
  const float saturated = stack.radiance(kSaturatedCode) - 0.5f * stack.unit;
  std::transform(samples_.begin(), samples_.end(), weights_.begin(),
                 [=](float value) { return value >= saturated ? -1.0f : 1.0f; });
  if (stack.full >= saturated) return;
  for (float& value : samples_) {
    if (value >= saturated) value = stack.full;
  }
}

void SampleTile::need_weights() {
  if (!weighted_) weights_.assign(samples_.size(), 1.0f);
  weighted_ = true;
}

void SampleTile::load_brackets(const FrameStack& stack, size_t row_start, int lane_count,
                               const SampleNoise& noise) {
  weighted_ = true;
  weights_.resize(samples_.size());
  size_t sample = 0;
  for (const SweepLayout& sweep : layout_.sweeps) {
    for (const Shot& shot : sweep.shots) {
      for (int lane = 0; lane < lane_count; ++lane) {
        const size_t index = row_start + static_cast<size_t>(lane);
        const MergedSample merged = merge(stack, shot, index, noise);
        const size_t block = lane / kBlockLanes;
        const size_t at =
            (block * sample_count_ + sample) * kBlockLanes + static_cast<size_t>(lane % kBlockLanes);
        samples_[at] = static_cast<float>(merged.radiance);
        const auto weight = static_cast<float>(noise.variance(0.0) / merged.variance);
        weights_[at] = merged.saturated ? -weight : weight;
      }
      ++sample;
    }
  }
}

std::array<float, kBlockLanes> SampleTile::median_near(int block,
                                                       const std::array<float, kBlockLanes>& middle,
                                                       const std::array<float, kBlockLanes>& reach) const {
  std::array<float, kBlockLanes> median;
  internal::median_near(samples(block, 0), sample_count_, middle.data(), reach.data(), median.data());
  return median;
}

void SampleTile::load_areas(const FrameStack& stack, int row, int block, int first_lane, int lane_count,
                            const SampleNoise& noise, const std::array<float, kBlockLanes>& one,
                            const std::array<bool, kBlockLanes>& clipped) {
  const size_t start = stack.sample_index(0, row, 0) + static_cast<size_t>(first_lane);
  size_t at = area_place(block, 0);
  for (const std::vector<AreaFrames>& areas : layout_.areas) {
    for (const AreaFrames& area : areas) {
      for (size_t lane = 0; lane < static_cast<size_t>(lane_count); ++lane) {
        const MergedSample seen = merge(stack, area.shot, start + lane, noise);
        const auto radiance = static_cast<float>(seen.radiance);
        const float own = one[lane] > 0.0f ? one[lane] / static_cast<float>(area.shot.size())
                                           : static_cast<float>(seen.variance);
        areas_[at + lane] = radiance;
        area_variances_[at + lane] = seen.saturated                               ? INFINITY
                                     : clipped[lane] && radiance <= stack.cut_off ? -own
                                                                                  : own;
      }
      at += kBlockLanes;
    }
  }
}

std::array<float, kBlockLanes> SampleTile::cut_off(int block) const {
  std::array<float, kBlockLanes> count{};
  internal::count_cut_off(samples(block, 0), sample_count_, cut_off_, count.data());
  return count;
}

void SampleTile::replace_cut_off(int block, const std::array<float, kBlockLanes>& noise_sd) {
  constexpr std::ptrdiff_t kNeighbours = 3;  // each way
  std::vector<std::array<float, kBlockLanes>> sums;
  for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
    float* const sweep = samples(block, s);
    const auto count = std::ssize(layout_.sweeps[s].shots);
    // sums[i]: of the samples before i.
    sums.assign(static_cast<size_t>(count) + 1, {});
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      for (size_t lane = 0; lane < kBlockLanes; ++lane)
        sums[i + 1][lane] = sums[i][lane] + sweep[i * kBlockLanes + static_cast<std::ptrdiff_t>(lane)];
    }
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      const auto from = static_cast<size_t>(std::max<std::ptrdiff_t>(i - kNeighbours, 0)),
                 to = static_cast<size_t>(std::min(i + kNeighbours + 1, count));
      for (size_t lane = 0; lane < kBlockLanes; ++lane) {
        float& sample = sweep[i * kBlockLanes + static_cast<std::ptrdiff_t>(lane)];
        if (sample > cut_off_ || noise_sd[lane] <= 0.0f) continue;
        const float mean = (sums[to][lane] - sums[from][lane]) / static_cast<float>(to - from) - cut_off_;
        sample = cut_off_ - noise_sd[lane] * expected_below_zero(mean / noise_sd[lane]);
      }
    }
  }
}

}  // namespace glasswing
