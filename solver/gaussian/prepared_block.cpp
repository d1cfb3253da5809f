#include "solver/gaussian/prepared_block.h"

#include <algorithm>
#include <cmath>

#include "solver/gaussian/sample_kernel.h"

namespace glasswing {
namespace {

constexpr float kPeakSd = 3.0f;      // a peak is as many standard deviations high
constexpr float kPeakShare = 2e-3f;  // of the highest sample: below it peaks are errors of the model
constexpr float kFewCutOff = 0.02f;  // of the samples: clipping hardly matters

// Whether all steps are equal to a hundredth.
bool is_even(const std::vector<double>& r_px) {
  const double step_px = (r_px.back() - r_px.front()) / static_cast<double>(r_px.size() - 1);
  for (size_t i = 1; i < r_px.size(); ++i) {
    if (std::abs(r_px[i] - r_px[i - 1] - step_px) > 0.01 * step_px) return false;
  }
  return true;
}

}  // namespace

BlockPreparer::BlockPreparer(const StackLayout& layout, const std::vector<SweptMonitor>& monitors,
                             const SampleNoise& noise, bool known)
    : layout_(layout), monitors_(monitors), noise_(noise), known_(known) {
  double exposures = 0.0;
  for (const ExposedFrame& exposed : layout.stage.black) exposures += 1.0 / (exposed.scale * exposed.scale);
  dark_noise_ = static_cast<float>(1.0 / std::sqrt(exposures));
  for (const SweepLayout& sweep : layout.sweeps) {
    Grid grid{.even = is_even(sweep.r_px),
              .step_px = 0.0,
              .count = static_cast<int>(sweep.r_px.size()),
              .samples = {}};
    const double length_px = sweep.r_px.back() - sweep.r_px.front();
    if (!grid.even) {
      grid.step_px = 0.5 * sweep.sigma_px;
      grid.count = static_cast<int>(length_px / grid.step_px) + 1;
      grid.samples.resize(static_cast<size_t>(grid.count) * kBlockLanes);
    } else {
      grid.step_px = length_px / static_cast<double>(grid.count - 1);
    }
    grids_.push_back(std::move(grid));
    for (const auto& peak : sweep.peak) {
      for (const double own : peak) unit_peaks_ = unit_peaks_ && own == 1.0;
    }
  }
}

void BlockPreparer::find_inverse_peaks() {
  for (int phase = 0; phase < kChannels; ++phase) {
    for (const SweepLayout& sweep : layout_.sweeps) {
      for (const auto& peak : sweep.peak) {
        for (const int channel : channels_[phase]) {
          const double own = peak[channel];
          inverse_peak_[phase].push_back(own > 0.0 ? static_cast<float>(1.0 / own) : 0.0f);
        }
      }
    }
  }
}

PreparedBlock BlockPreparer::prepare(const BlockStart& start, SampleTile& tile, int block) {
  PreparedBlock own{.first_lane = start.first_lane,
                    .phase = start.phase,
                    .lanes = start.lanes,
                    .noise_sd = start.noise_sd,
                    .black = start.black,
                    .floor = {},
                    .peaks = {}};
  if (own.lanes == 0) return own;
  replace_cut_off(own, tile, block);
  // The light without stripes: the median of the black frame and all samples that no stripe reached.
  PreparedBlock::Lanes reach{};
  for (size_t lane = 0; lane < kBlockLanes; ++lane)
    reach[lane] = std::max(3.0f * own.noise_sd[lane] * dark_noise_, 2e-5f);
  own.baseline = tile.median_near(block, own.black, reach);
  const PreparedBlock::Lanes highest = scale(own, tile, block);
  find_peaks(highest, own, tile, block);
  return own;
}

void BlockPreparer::replace_cut_off(PreparedBlock& own, SampleTile& tile, int block) const {
  const PreparedBlock::Lanes share = tile.cut_off(block);
  PreparedBlock::Lanes sd{};
  bool any = false;
  for (size_t lane = 0; lane < kBlockLanes; ++lane) {
    own.clipped[lane] = share[lane] > kFewCutOff;
    if (own.clipped[lane]) sd[lane] = own.noise_sd[lane] * dark_noise_;
    any = any || own.clipped[lane];
  }
  if (any) tile.replace_cut_off(block, sd);
}

// Weights are in frames of the reference exposure, times the square of the peak.
PreparedBlock::Lanes BlockPreparer::scale(PreparedBlock& own, SampleTile& tile, int block) const {
  internal::LaneScale scale{};
  PreparedBlock::Lanes highest{}, least;
  least.fill(1.0f);
  for (size_t lane = 0; lane < kBlockLanes; ++lane) {
    const float sd = own.noise_sd[lane];
    scale.baseline[lane] = own.baseline[lane];
    // Merged brackets carry their own noise.
    if (layout_.one_frame_a_shot) scale.gain[lane] = static_cast<float>(noise_.gain);
    scale.read_variance[lane] = known_ ? static_cast<float>(noise_.variance(0.0))
                                       : std::max(sd * sd, static_cast<float>(kMinStep * kMinStep));
    scale.dark_variance[lane] =
        scale.read_variance[lane] + static_cast<float>(noise_.gain) * std::max(own.baseline[lane], 0.0f);
  }
  for (const SweptMonitor& monitor : monitors_) {
    internal::LaneSums sums{};
    std::ranges::copy(least, sums.least_weight);
    for (const size_t s : monitor.sweeps) {
      float* const samples = tile.samples(block, s);
      const float* const inverse = inverse_peak(own.phase) + (tile.samples(0, s) - tile.samples(0, 0));
      internal::scale_samples(samples, tile.weighted() ? tile.weights(block, s) : nullptr, inverse,
                              layout_.sweeps[s].r_px.size(), scale, sums);
    }
    PreparedBlock::FloorSums& floor = own.floor.emplace_back();
    std::ranges::copy(sums.floor_squares, floor.squares.begin());
    std::ranges::copy(sums.floor_products, floor.products.begin());
    for (size_t lane = 0; lane < kBlockLanes; ++lane) {
      highest[lane] = std::max(highest[lane], sums.highest[lane]);
      if (sums.least_weight[lane] < 0.0f) own.bounded |= 1u << lane;
    }
  }
  return highest;
}

void BlockPreparer::find_peaks(const PreparedBlock::Lanes& highest, PreparedBlock& own, SampleTile& tile,
                               int block) {
  std::vector<SweepBlock> sweeps;
  for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
    const SweepLayout& sweep = layout_.sweeps[s];
    Grid& grid = grids_[s];
    const float* samples = tile.samples(block, s);
    if (!grid.even) {
      size_t before = 0;
      for (int i = 0; i < grid.count; ++i) {
        const double r = sweep.r_px.front() + i * grid.step_px;
        while (before + 2 < sweep.r_px.size() && sweep.r_px[before + 1] <= r) ++before;
        const auto part =
            static_cast<float>((r - sweep.r_px[before]) / (sweep.r_px[before + 1] - sweep.r_px[before]));
        for (size_t lane = 0; lane < kBlockLanes; ++lane) {
          const float a = samples[before * kBlockLanes + lane],
                      b = samples[(before + 1) * kBlockLanes + lane];
          grid.samples[static_cast<size_t>(i) * kBlockLanes + lane] = a + part * (b - a);
        }
      }
      samples = grid.samples.data();
    }
    sweeps.push_back(
        {.y = samples, .count = grid.count, .first_r_px = sweep.r_px.front(), .step_px = grid.step_px});
  }
  PreparedBlock::Lanes floor{}, noise{};
  for (size_t lane = 0; lane < kBlockLanes; ++lane) {
    noise[lane] = own.noise_sd[lane] * dark_noise_;
    floor[lane] =
        std::max(kPeakSd * std::max(noise[lane], static_cast<float>(kMinNoise)), kPeakShare * highest[lane]);
  }
  finder_.find(sweeps, floor, noise, own.lanes, own.peaks);
}

}  // namespace glasswing
