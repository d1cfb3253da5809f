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
}

void SampleTile::load(const FrameStack& stack, int row, int first_lane, int lane_count,
                      const SampleNoise& noise) {
  block_count_ = (lane_count + kBlockLanes - 1) / kBlockLanes;
  const size_t start = stack.sample_index(0, row, 0) + static_cast<size_t>(first_lane);
  weighted_ = false;
  if (!layout_.one_frame_a_shot) {
    load_brackets(stack, start, lane_count, noise);
    return;
  }
  std::uint16_t highest = 0;
  size_t sample = 0;
  for (const SweepLayout& sweep : layout_.sweeps) {
    for (const Shot& shot : sweep.shots) {
      const std::uint16_t* codes = stack.rows[static_cast<size_t>(shot.front().frame)].data() + start;
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
        const size_t block = static_cast<size_t>(lane / kBlockLanes);
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

std::array<float, kBlockLanes> SampleTile::zeros(int block) const {
  std::array<float, kBlockLanes> count{}, pairs{};
  const float* sample = samples(block, 0);
  for (size_t i = 0; i + 1 < sample_count_; ++i, sample += kBlockLanes) {
    for (size_t lane = 0; lane < kBlockLanes; ++lane) {
      const bool zero = sample[lane] <= 0.0f, next = sample[lane + kBlockLanes] <= 0.0f;
      count[lane] += zero ? 1.0f : 0.0f;
      pairs[lane] += zero && next ? 1.0f : 0.0f;
    }
  }
  for (size_t lane = 0; lane < kBlockLanes; ++lane) {
    // Noise leaves every second sample of a dark lane as it is.
    constexpr float kSideBySide = 0.75f;
    count[lane] =
        pairs[lane] > kSideBySide * count[lane] ? 0.0f : count[lane] / static_cast<float>(sample_count_);
  }
  return count;
}

void SampleTile::replace_zeros(int block, const std::array<float, kBlockLanes>& noise_sd) {
  constexpr std::ptrdiff_t kNeighbours = 3;  // each way
  std::vector<std::array<float, kBlockLanes>> sums;
  for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
    float* const sweep = samples(block, s);
    const auto count = std::ssize(layout_.sweeps[s].shots);
    // sums[i]: of the samples before i.
    sums.assign(static_cast<size_t>(count) + 1, {});
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      for (size_t lane = 0; lane < kBlockLanes; ++lane)
        sums[static_cast<size_t>(i + 1)][lane] =
            sums[static_cast<size_t>(i)][lane] + sweep[i * kBlockLanes + static_cast<std::ptrdiff_t>(lane)];
    }
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      const auto from = static_cast<size_t>(std::max<std::ptrdiff_t>(i - kNeighbours, 0)),
                 to = static_cast<size_t>(std::min(i + kNeighbours + 1, count));
      for (size_t lane = 0; lane < kBlockLanes; ++lane) {
        float& sample = sweep[i * kBlockLanes + static_cast<std::ptrdiff_t>(lane)];
        if (sample > 0.0f || noise_sd[lane] <= 0.0f) continue;
        const float mean = (sums[to][lane] - sums[from][lane]) / static_cast<float>(to - from);
        sample = -noise_sd[lane] * expected_below_zero(mean / noise_sd[lane]);
      }
    }
  }
}

}  // namespace glasswing
