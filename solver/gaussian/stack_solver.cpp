#include "solver/gaussian/stack_solver.h"

#include <algorithm>
#include <cmath>

#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr int kStretch = SampleTile::kMaxBlocks * kBlockLanes;
constexpr double kMinStep = 1.0 / 65535.0;
constexpr float kMinFloor = 0.0015f;  // of full scale: fainter peaks are stray light

// Whether all steps are equal to a hundredth.
bool is_even(const std::vector<double>& r_px) {
  const double step_px = (r_px.back() - r_px.front()) / static_cast<double>(r_px.size() - 1);
  for (size_t i = 1; i < r_px.size(); ++i) {
    if (std::abs(r_px[i] - r_px[i - 1] - step_px) > 0.01 * step_px) return false;
  }
  return true;
}

// Whether a sweep's steps are so wide that a peak's second differences are as large as its height.
bool is_coarse(const SweepLayout& sweep) {
  const double length_px = sweep.r_px.back() - sweep.r_px.front();
  return length_px > 0.75 * sweep.sigma_px * static_cast<double>(sweep.r_px.size() - 1);
}

void forget_modes(int x, int y, Matte& matte) {
  matte.flags(x, y) &= static_cast<std::uint8_t>(~kFlagPoorFit);
  for (int c = 0; c < kChannels; ++c) std::ranges::fill(matte.modes(x, y, c), Mode{});
}

}  // namespace

StackSolver::StackSolver(const FrameStack& stack, const StackLayout& layout, int max_modes,
                         double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      max_modes_(max_modes),
      lane_count_(stack.width_px * kChannels),
      surroundings_(stack, layout.stage, silhouette_tolerance),
      noise_known_(surroundings_.noise_known()),
      coarse_(std::ranges::any_of(layout.sweeps, is_coarse)),
      noise_(surroundings_.noise()),
      tile_(layout) {
  for (size_t s = 0; s < layout.sweeps.size(); ++s) {
    const SweepLayout& sweep = layout.sweeps[s];
    if (textures_.empty() || textures_.back().texture != sweep.texture) {
      const EmptyMonitor& monitor = layout.stage.monitors[static_cast<size_t>(sweep.texture)];
      textures_.push_back({.texture = sweep.texture,
                           .extent = {.width_px = static_cast<double>(monitor.width_px),
                                      .height_px = static_cast<double>(monitor.height_px)},
                           .samples = {},
                           .sweeps = {}});
    }
    textures_.back().sweeps.push_back(s);
    textures_.back().samples.add(
        {.cos_phi = sweep.cos_phi, .sin_phi = sweep.sin_phi, .sigma_px = sweep.sigma_px}, sweep.r_px);
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
  }
  for (int first = 0; first < kChannels; ++first) {
    for (const SweepLayout& sweep : layout.sweeps) {
      for (const auto& peak : sweep.peak) {
        for (int lane = 0; lane < kBlockLanes; ++lane) {
          const double own = peak[static_cast<size_t>((first + lane) % kChannels)];
          inverse_peak_[first].push_back(own > 0.0 ? static_cast<float>(1.0 / own) : 0.0f);
        }
      }
    }
  }
  for (const SweepLayout& sweep : layout.sweeps) {
    for (const auto& peak : sweep.peak) {
      for (const double own : peak) unit_peaks_ = unit_peaks_ && own == 1.0;
    }
  }
  double exposures = 0.0;
  for (const ExposedFrame& exposed : layout.stage.black) exposures += 1.0 / (exposed.scale * exposed.scale);
  dark_noise_ = static_cast<float>(1.0 / std::sqrt(exposures));
  usual_.resize(textures_.size());
  noise_sd_.resize(static_cast<size_t>(lane_count_));
  to_solve_.resize(static_cast<size_t>(lane_count_ / kChannels));
}

void StackSolver::estimate_row_noise(int y) {
  if (coarse_ && layout_.wave_noise.known()) {
    std::ranges::fill(noise_sd_, static_cast<float>(layout_.wave_noise.of_row(stack_, y)));
    return;
  }
  for (int first = 0; first < lane_count_; first += kStretch) {
    const int count = std::min(kStretch, lane_count_ - first);
    tile_.load(stack_, y, first, count, noise_);
    for (int block = 0; block < tile_.block_count(); ++block) {
      std::array<float, kBlockLanes> sum{};
      for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
        const auto own = estimate_noise({.y = tile_.samples(block, s),
                                         .count = static_cast<int>(layout_.sweeps[s].r_px.size()),
                                         .first_r_px = 0.0,
                                         .step_px = 1.0});
        for (size_t lane = 0; lane < kBlockLanes; ++lane) sum[lane] += own[lane];
      }
      for (int lane = 0; lane < std::min(kBlockLanes, count - block * kBlockLanes); ++lane) {
        noise_sd_[static_cast<size_t>(first + block * kBlockLanes + lane)] =
            sum[static_cast<size_t>(lane)] / (dark_noise_ * static_cast<float>(layout_.sweeps.size()));
      }
    }
  }
}

std::vector<double> StackSolver::read_noise() const {
  std::vector<double> read_sd(to_solve_.size());
  for (size_t x = 0; x < read_sd.size(); ++x) {
    double variance = 0.0;
    for (size_t c = 0; c < kChannels; ++c) {
      const auto sd = static_cast<double>(noise_sd_[x * kChannels + c]);
      variance += sd * sd / kChannels;
    }
    read_sd[x] = std::sqrt(std::max(variance, kMinStep * kMinStep));
  }
  return read_sd;
}

void StackSolver::solve_row(int y, Matte& matte) {
  if (noise_known_) {
    for (int lane = 0; lane < lane_count_; ++lane) {
      noise_sd_[static_cast<size_t>(lane)] =
          static_cast<float>(std::sqrt(noise_.variance(static_cast<double>(surroundings_.black(y, lane)))));
    }
  } else {
    estimate_row_noise(y);
  }
  const SettledRow row =
      surroundings_.settle_row(y, noise_known_ ? std::vector<double>{} : read_noise(), matte);
  for (size_t x = 0; x < to_solve_.size(); ++x) {
    to_solve_[x] = row.object[x] || row.open[x];
    // The sweeps determine its position better.
    if (row.open[x]) forget_modes(static_cast<int>(x), y, matte);
  }
  for (int first = 0; first < lane_count_; first += kStretch) {
    const int count = std::min(kStretch, lane_count_ - first);
    const auto begin = to_solve_.begin() + first / kChannels,
               end = to_solve_.begin() + (first + count - 1) / kChannels + 1;
    if (std::find(begin, end, true) == end) continue;
    tile_.load(stack_, y, first, count, noise_);
    if (noise_.gain > 0.0 || !unit_peaks_) tile_.need_weights();
    blocks_.resize(static_cast<size_t>(tile_.block_count()));
    for (int block = 0; block < tile_.block_count(); ++block) {
      blocks_[static_cast<size_t>(block)].first_lane = first + block * kBlockLanes;
      prepare_block(y, block);
    }
    for (size_t t = 0; t < textures_.size(); ++t) fit_usual(t);
    for (int block = 0; block < tile_.block_count(); ++block) {
      for (int lane = 0; lane < kBlockLanes; ++lane) {
        if ((blocks_[static_cast<size_t>(block)].lanes >> lane & 1u) != 0) solve_lane(block, lane, y, matte);
      }
    }
  }
}

void StackSolver::prepare_block(int y, int block_index) {
  Block& block = blocks_[static_cast<size_t>(block_index)];
  block.lanes = block.saturated = 0;
  std::array<float, kBlockLanes> dark{}, reach{}, floor{}, noise{};
  for (int lane = 0; lane < kBlockLanes && block.first_lane + lane < lane_count_; ++lane) {
    const int row_lane = block.first_lane + lane;
    const auto l = static_cast<size_t>(lane);
    if (!to_solve_[static_cast<size_t>(row_lane / kChannels)]) continue;
    block.lanes |= 1u << lane;
    dark[l] = surroundings_.black(y, row_lane);
    noise[l] = noise_sd_[static_cast<size_t>(row_lane)] * dark_noise_;
    floor[l] = std::max(3.5f * noise[l], kMinFloor);
    reach[l] = std::max(3.0f * noise[l], 2e-5f);
  }
  if (block.lanes == 0) return;
  // The light without stripes: the median of the black frame and all samples that no stripe reached.
  dark = tile_.median_near(block_index, dark, reach);
  for (float& r : reach) r *= 0.67f;
  block.baseline = tile_.median_near(block_index, dark, reach);
  const float* inverse_peak = inverse_peak_[block.first_lane % kChannels].data();
  float* samples = tile_.samples(block_index, 0);
  if (tile_.weighted()) weigh(block_index, inverse_peak);
  for (size_t i = 0; i < tile_.sample_count(); ++i, samples += kBlockLanes, inverse_peak += kBlockLanes) {
    for (size_t lane = 0; lane < kBlockLanes; ++lane)
      samples[lane] = (samples[lane] - block.baseline[lane]) * inverse_peak[lane];
  }
  find_peaks(block_index, floor, noise);
}

// In frames of the reference exposure, times the square of the peak.
void StackSolver::weigh(int block_index, const float* inverse_peak) {
  Block& block = blocks_[static_cast<size_t>(block_index)];
  const float* samples = tile_.samples(block_index, 0);
  float* weights = tile_.weights(block_index, 0);
  std::array<float, kBlockLanes> least, read_variance{}, dark_variance{}, gain{};
  least.fill(1.0f);
  for (int lane = 0; lane < kBlockLanes && block.first_lane + lane < lane_count_; ++lane) {
    const auto l = static_cast<size_t>(lane);
    const SampleNoise& own = noise_;
    // Merged brackets carry their own noise.
    if (layout_.one_frame_a_shot) gain[l] = static_cast<float>(own.gain);
    const float sd = noise_sd_[static_cast<size_t>(block.first_lane + lane)];
    read_variance[l] = noise_known_ ? static_cast<float>(own.variance(0.0))
                                    : std::max(sd * sd, static_cast<float>(kMinStep * kMinStep));
    dark_variance[l] = read_variance[l] + static_cast<float>(own.gain) * std::max(block.baseline[l], 0.0f);
  }
  for (size_t i = 0; i < tile_.sample_count(); ++i) {
    for (size_t lane = 0; lane < kBlockLanes; ++lane, ++samples, ++weights, ++inverse_peak) {
      least[lane] = std::min(least[lane], *weights);
      const float variance = read_variance[lane] + gain[lane] * std::max(*samples, 0.0f);
      *weights = *inverse_peak > 0.0f
                     ? *weights * dark_variance[lane] / (variance * *inverse_peak * *inverse_peak)
                     : 0.0f;
    }
  }
  for (size_t lane = 0; lane < kBlockLanes; ++lane) {
    if (least[lane] == 0.0f) block.saturated |= 1u << lane;
  }
}

void StackSolver::find_peaks(int block, const std::array<float, kBlockLanes>& floor,
                             const std::array<float, kBlockLanes>& noise) {
  std::vector<SweepBlock> sweeps;
  for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
    const SweepLayout& sweep = layout_.sweeps[s];
    Grid& grid = grids_[s];
    const float* samples = tile_.samples(block, s);
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
  Block& own = blocks_[static_cast<size_t>(block)];
  finder_.find(sweeps, floor, noise, own.lanes, own.peaks);
}

int StackSolver::max_modes(int block, int lane) const {
  const Block& own = blocks_[static_cast<size_t>(block)];
  const auto lit = std::count_if(textures_.begin(), textures_.end(), [&](const Texture& texture) {
    return std::all_of(texture.sweeps.begin(), texture.sweeps.end(),
                       [&](size_t s) { return own.peaks[s][static_cast<size_t>(lane)].count > 0; });
  });
  return std::max(1, max_modes_ / std::max(static_cast<int>(lit), 1));
}

std::vector<Peaks> StackSolver::peaks_of(size_t texture, int block, int lane) const {
  std::vector<Peaks> peaks;
  for (const size_t s : textures_[texture].sweeps)
    peaks.push_back(blocks_[static_cast<size_t>(block)].peaks[s][static_cast<size_t>(lane)]);
  return peaks;
}

void StackSolver::fit_usual(size_t t) {
  const Texture& texture = textures_[t];
  std::vector<std::optional<JointFit>>& usual = usual_[t];
  usual.assign(blocks_.size() * kBlockLanes, std::nullopt);
  if (texture.sweeps.size() > BatchPixel::kMaxSweeps) return;
  std::array<std::vector<BatchPixel>, kMaxFootprints> batches;  // by count of modes
  std::array<std::vector<size_t>, kMaxFootprints> places;
  for (int block = 0; block < static_cast<int>(blocks_.size()); ++block) {
    for (int lane = 0; lane < kBlockLanes; ++lane) {
      if ((blocks_[static_cast<size_t>(block)].lanes >> lane & 1u) == 0) continue;
      BatchPixel pixel;
      pixel.start = usual_start(texture.samples, peaks_of(t, block, lane), max_modes(block, lane));
      const bool cut = std::any_of(pixel.start.begin(), pixel.start.end(),
                                   [&](const Footprint& mode) { return near_edge(mode, texture.extent); });
      if (pixel.start.empty() || cut) continue;
      for (size_t k = 0; k < texture.sweeps.size(); ++k) {
        pixel.y[k] = tile_.samples(block, texture.sweeps[k]) + lane;
        if (tile_.weighted()) pixel.weight[k] = tile_.weights(block, texture.sweeps[k]) + lane;
      }
      const auto batch = static_cast<size_t>(pixel.start.size() - 1);
      batches[batch].push_back(pixel);
      places[batch].push_back(static_cast<size_t>(block * kBlockLanes + lane));
    }
  }
  std::vector<JointFit> fits;
  for (size_t batch = 0; batch < batches.size(); ++batch) {
    fits.resize(batches[batch].size());
    fit_batch(texture.samples, kBlockLanes, batches[batch], fits);
    for (size_t i = 0; i < fits.size(); ++i) {
      const bool cut = std::any_of(fits[i].modes.begin(), fits[i].modes.end(),
                                   [&](const Footprint& mode) { return near_edge(mode, texture.extent); });
      if (!cut) usual[places[batch][i]] = fits[i];
    }
  }
}

JointFit StackSolver::search(size_t t, int block, int lane, double noise_sd, const JointFit* usual) {
  const Texture& texture = textures_[t];
  samples_.layout = &texture.samples;
  samples_.y.assign(static_cast<size_t>(texture.samples.padded_count()), 0.0f);
  samples_.weight.assign(samples_.y.size(), 0.0f);
  for (size_t k = 0; k < texture.sweeps.size(); ++k) {
    const size_t s = texture.sweeps[k];
    const auto first = static_cast<size_t>(texture.samples.sweeps[k].first);
    const float* samples = tile_.samples(block, s) + lane;
    const float* weights = tile_.weighted() ? tile_.weights(block, s) + lane : nullptr;
    for (size_t i = 0; i < layout_.sweeps[s].r_px.size(); ++i) {
      samples_.y[first + i] = samples[i * kBlockLanes];
      samples_.weight[first + i] = weights != nullptr ? weights[i * kBlockLanes] : 1.0f;
    }
  }
  return find_footprints(samples_, peaks_of(t, block, lane), texture.extent, noise_sd, max_modes(block, lane),
                         workspace_, usual);
}

void StackSolver::solve_lane(int block_index, int lane, int y, Matte& matte) {
  const Block& block = blocks_[static_cast<size_t>(block_index)];
  const int x = (block.first_lane + lane) / kChannels, channel = (block.first_lane + lane) % kChannels;
  const auto noise_sd = static_cast<double>(noise_sd_[static_cast<size_t>(block.first_lane + lane)]);
  matte.foreground(x, y)[static_cast<size_t>(channel)] = block.baseline[static_cast<size_t>(lane)];
  std::uint8_t flags = matte.flags(x, y);
  if ((block.saturated >> lane & 1u) != 0) flags |= kFlagSaturated;
  std::vector<Mode> found;
  bool usable = false;
  for (size_t t = 0; t < textures_.size(); ++t) {
    const std::optional<JointFit>& usual = usual_[t][static_cast<size_t>(block_index * kBlockLanes + lane)];
    const JointFit fit = usual && suffices(*usual, noise_sd)
                             ? *usual
                             : search(t, block_index, lane, noise_sd,
                                      usual && needs_more(*usual, noise_sd) ? &*usual : nullptr);
    double strongest = 0.0;
    for (int m = 0; m < fit.modes.size(); ++m) {
      const auto i = static_cast<size_t>(m);
      found.push_back(mode_of(fit.modes[m], fit.weight_sd[i], fit.centre_sd_px[i], textures_[t].texture));
      strongest = std::max(strongest, fit.modes[m].weight);
    }
    if (!fit.modes.empty() && !fit.converged) flags |= kFlagNotConverged;
    const double rms = std::sqrt(fit.near_chi2 / std::max(fit.near_count, 1));
    if (rms > std::max(4.0 * noise_sd, 0.1 * strongest)) flags |= kFlagPoorFit;
    usable = usable || !fit.modes.empty() || has_samples(t, block_index, lane);
  }
  if (!usable) flags |= kFlagNoData;
  std::stable_sort(found.begin(), found.end(),
                   [](const Mode& a, const Mode& b) { return a.weight > b.weight; });
  const std::span<Mode> modes = matte.modes(x, y, channel);
  std::copy_n(found.begin(), std::min(found.size(), modes.size()), modes.begin());
  matte.flags(x, y) = flags;
}

bool StackSolver::has_samples(size_t texture, int block, int lane) const {
  if (!tile_.weighted()) return true;
  for (const size_t s : textures_[texture].sweeps) {
    const float* weights = tile_.weights(block, s) + lane;
    for (size_t i = 0; i < layout_.sweeps[s].r_px.size(); ++i) {
      if (weights[i * kBlockLanes] > 0.0f) return true;
    }
  }
  return false;
}

}  // namespace glasswing
