#include "solver/gaussian/stack_solver.h"

#include <algorithm>
#include <cmath>

#include "solver/method/clipped_noise.h"
#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr int kStretch = SampleTile::kMaxBlocks * kBlockLanes;
constexpr double kMinStep = 1.0 / 65535.0;
constexpr float kMinFloor = 0.0015f;  // of full scale: fainter peaks are stray light
constexpr float kFewZeros = 0.02f;    // of the samples: clipping hardly matters
constexpr double kBoundSd = 0.02;     // by which a weight may be above 1
constexpr double kBound = 0.002;      // and that much without a flag, however well known
constexpr double kMoreThanNoise = 3.0, kBeyondNoise = 4.0;  // standard errors of what white has beyond modes
constexpr double kLacking = 0.05;                           // of white
constexpr int kNeighbours = 4;  // each way, whose white says whether broad light is to be expected
constexpr int kTurns = 3;       // of finding broad light and fitting the other modes
constexpr int kRounds = 8;      // of fits after the first, with white and bars weighed anew
constexpr int kLong = 60;       // iterations of one that has to leave its start behind
constexpr int kPolish = 12;     // iterations of a fit that had converged without white

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

bool is_positive(const JointFit& fit) {
  return std::isfinite(fit.floor) && std::all_of(fit.modes.begin(), fit.modes.end(),
                                                 [](const Footprint& mode) { return mode.weight > 0.0; });
}

bool is_finite(const Mode& mode) {
  return std::isfinite(mode.weight + mode.x_px + mode.y_px + mode.xx_px2 + mode.xy_px2 + mode.yy_px2);
}

void forget_modes(int x, int y, Matte& matte) {
  matte.flags(x, y) &= static_cast<std::uint8_t>(~kFlagPoorFit);
  for (int c = 0; c < kChannels; ++c) std::ranges::fill(matte.modes(x, y, c), Mode{});
}

}  // namespace

std::vector<SweptMonitor> swept_monitors(const StackLayout& layout) {
  std::vector<SweptMonitor> monitors;
  for (size_t s = 0; s < layout.sweeps.size(); ++s) {
    const SweepLayout& sweep = layout.sweeps[s];
    if (monitors.empty() || monitors.back().texture != sweep.texture) {
      const EmptyMonitor& monitor = layout.stage.monitors[static_cast<size_t>(sweep.texture)];
      monitors.push_back({.texture = sweep.texture,
                          .extent = {.width_px = static_cast<double>(monitor.width_px),
                                     .height_px = static_cast<double>(monitor.height_px)},
                          .samples = {},
                          .sweeps = {},
                          .areas = {}});
    }
    monitors.back().sweeps.push_back(s);
    monitors.back().samples.add(
        {.cos_phi = sweep.cos_phi, .sin_phi = sweep.sin_phi, .sigma_px = sweep.sigma_px}, sweep.r_px);
  }
  for (SweptMonitor& monitor : monitors) {
    for (const AreaFrames& area : layout.areas[static_cast<size_t>(monitor.texture)])
      monitor.areas.push_back(area.lit);
    if (!monitor.areas.empty()) monitor.broad.emplace(monitor.samples, monitor.areas, monitor.extent);
  }
  return monitors;
}

StackSolver::StackSolver(const FrameStack& stack, const StackLayout& layout,
                         const std::vector<SweptMonitor>& monitors, int max_modes,
                         double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      max_modes_(max_modes),
      pixel_lanes_(stack.samples_per_pixel()),
      lane_count_(stack.width_px * pixel_lanes_),
      surroundings_(stack, layout.stage, silhouette_tolerance),
      noise_known_(surroundings_.noise_known()),
      coarse_(std::ranges::any_of(layout.sweeps, is_coarse)),
      noise_(surroundings_.noise()),
      textures_(monitors),
      tile_(layout) {
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
  }
  for (int phase = 0; phase < kChannels; ++phase) {
    for (const SweepLayout& sweep : layout.sweeps) {
      for (const auto& peak : sweep.peak) {
        for (int lane = 0; lane < kBlockLanes; ++lane) {
          const double own = peak[static_cast<size_t>(channel_in(phase, lane))];
          inverse_peak_[phase].push_back(own > 0.0 ? static_cast<float>(1.0 / own) : 0.0f);
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
  settled_.resize(textures_.size());
  noise_sd_.resize(static_cast<size_t>(lane_count_));
  unclipped_.assign(noise_sd_.size(), 1.0f);
  to_solve_.resize(static_cast<size_t>(stack.width_px));
}

int StackSolver::phase_of(int first_lane, int y) const {
  return stack_.mosaic ? (stack_.first_row + y) % 2 : first_lane % kChannels;
}

int StackSolver::channel_in(int phase, int lane) const {
  return stack_.mosaic ? stack_.mosaic->channel(lane * stack_.column_step, phase)
                       : (phase + lane) % kChannels;
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
      const std::array<float, kBlockLanes> zeros = tile_.zeros(block);
      for (int lane = 0; lane < std::min(kBlockLanes, count - block * kBlockLanes); ++lane) {
        const auto at = static_cast<size_t>(first + block * kBlockLanes + lane),
                   l = static_cast<size_t>(lane);
        noise_sd_[at] = sum[l] / (dark_noise_ * static_cast<float>(layout_.sweeps.size()));
        unclipped_[at] = sd_before_clipping(zeros[l]);
      }
    }
  }
}

std::vector<double> StackSolver::read_noise() const {
  std::vector<double> read_sd(to_solve_.size());
  for (size_t x = 0; x < read_sd.size(); ++x) {
    double variance = 0.0;
    const auto lanes = static_cast<size_t>(pixel_lanes_);
    for (size_t lane = x * lanes; lane < (x + 1) * lanes; ++lane) {
      const auto sd = static_cast<double>(noise_sd_[lane]);
      variance += sd * sd / pixel_lanes_;
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
  if (!noise_known_) {
    for (size_t lane = 0; lane < noise_sd_.size(); ++lane) noise_sd_[lane] *= unclipped_[lane];
  }
  for (size_t x = 0; x < to_solve_.size(); ++x) {
    to_solve_[x] = row.object[x] || row.open[x];
    // The sweeps determine its position better.
    if (row.open[x]) forget_modes(static_cast<int>(x), y, matte);
  }
  for (int first = 0; first < lane_count_; first += kStretch) {
    const int count = std::min(kStretch, lane_count_ - first);
    const auto begin = to_solve_.begin() + first / pixel_lanes_,
               end = to_solve_.begin() + (first + count - 1) / pixel_lanes_ + 1;
    if (std::find(begin, end, true) == end) continue;
    tile_.load(stack_, y, first, count, noise_);
    if (noise_.gain > 0.0 || !unit_peaks_) tile_.need_weights();
    blocks_.resize(static_cast<size_t>(tile_.block_count()));
    for (int block = 0; block < tile_.block_count(); ++block) {
      blocks_[static_cast<size_t>(block)].first_lane = first + block * kBlockLanes;
      blocks_[static_cast<size_t>(block)].phase = phase_of(first + block * kBlockLanes, y);
      prepare_block(y, block);
    }
    for (size_t t = 0; t < textures_.size(); ++t) fit_usual(t);
    const auto for_lanes = [&](auto each) {
      for (int block = 0; block < tile_.block_count(); ++block) {
        for (int lane = 0; lane < kBlockLanes; ++lane) {
          if ((blocks_[static_cast<size_t>(block)].lanes >> lane & 1u) != 0)
            each(block, lane, static_cast<size_t>(block * kBlockLanes + lane));
        }
      }
    };
    for (size_t t = 0; t < textures_.size(); ++t) {
      settled_[t].assign(blocks_.size() * kBlockLanes, {});
      for_lanes([&](int block, int lane, size_t i) { settled_[t][i] = fit_sweeps(t, block, lane, y); });
      neighbours_have_more_.assign(settled_[t].size(), false);
      for_lanes([&](int, int, size_t i) { neighbours_have_more_[i] = neighbours_have_more(t, i); });
      for_lanes([&](int block, int lane, size_t i) {
        settle(t, block, lane, y, neighbours_have_more_[i], settled_[t][i]);
      });
    }
    for_lanes([&](int block, int lane, size_t) { store(block, lane, y, matte); });
  }
}

void StackSolver::prepare_block(int y, int block_index) {
  Block& block = blocks_[static_cast<size_t>(block_index)];
  block.lanes = block.saturated = 0;
  std::array<float, kBlockLanes> dark{}, reach{}, floor{}, noise{}, sd{};
  for (int lane = 0; lane < kBlockLanes && block.first_lane + lane < lane_count_; ++lane) {
    const int row_lane = block.first_lane + lane;
    const auto l = static_cast<size_t>(lane);
    if (!to_solve_[static_cast<size_t>(row_lane / pixel_lanes_)]) continue;
    block.lanes |= 1u << lane;
    dark[l] = surroundings_.black(y, row_lane);
    sd[l] = noise_sd_[static_cast<size_t>(row_lane)];
    noise[l] = sd[l] * dark_noise_;
    floor[l] = std::max(3.5f * noise[l], kMinFloor);
    reach[l] = std::max(3.0f * noise[l], 2e-5f);
  }
  if (block.lanes == 0) return;
  // The light without stripes: the median of the black frame and all samples that no stripe reached.
  dark = tile_.median_near(block_index, dark, reach);
  for (float& r : reach) r *= 0.67f;
  block.baseline = tile_.median_near(block_index, dark, reach);
  const std::array<float, kBlockLanes> zeros = tile_.zeros(block_index);
  for (size_t lane = 0; lane < kBlockLanes; ++lane) {
    block.clipped[lane] = zeros[lane] > kFewZeros;
    if (!block.clipped[lane]) sd[lane] = 0.0f;
  }
  tile_.replace_zeros(block_index, sd);
  const float* inverse_peak = inverse_peak_[block.phase].data();
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
    if (least[lane] < 0.0f) block.saturated |= 1u << lane;
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

std::vector<Peaks> StackSolver::peaks_of(size_t texture, int block, int lane) const {
  std::vector<Peaks> peaks;
  for (const size_t s : textures_[texture].sweeps)
    peaks.push_back(blocks_[static_cast<size_t>(block)].peaks[s][static_cast<size_t>(lane)]);
  return peaks;
}

void StackSolver::fit_usual(size_t t) {
  const SweptMonitor& texture = textures_[t];
  std::vector<std::optional<JointFit>>& usual = usual_[t];
  usual.assign(blocks_.size() * kBlockLanes, std::nullopt);
  if (texture.sweeps.size() > BatchPixel::kMaxSweeps) return;
  std::array<std::vector<BatchPixel>, kMaxFootprints> batches;  // by count of modes
  std::array<std::vector<size_t>, kMaxFootprints> places;
  for (int block = 0; block < static_cast<int>(blocks_.size()); ++block) {
    for (int lane = 0; lane < kBlockLanes; ++lane) {
      if ((blocks_[static_cast<size_t>(block)].lanes >> lane & 1u) == 0) continue;
      BatchPixel pixel;
      pixel.start = usual_start(texture.samples, peaks_of(t, block, lane), max_modes_);
      const bool cut = std::any_of(pixel.start.begin(), pixel.start.end(),
                                   [&](const Footprint& mode) { return near_edge(mode, texture.extent); });
      // Bounds and edges are for fit_jointly.
      const bool bounded = (blocks_[static_cast<size_t>(block)].saturated >> lane & 1u) != 0;
      if (pixel.start.empty() || cut || bounded) continue;
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

void StackSolver::load_samples(size_t t, int block_index, int lane) {
  const SweptMonitor& texture = textures_[t];
  const Block& block = blocks_[static_cast<size_t>(block_index)];
  const auto noise_sd = static_cast<double>(noise_sd_[static_cast<size_t>(block.first_lane + lane)]);
  samples_.layout = &texture.samples;
  samples_.areas.clear();
  samples_.floor_weight = INFINITY;
  samples_.bound_weight = std::pow(std::max(noise_sd, kMinStep) / kBoundSd, 2);
  const auto size = static_cast<size_t>(texture.samples.padded_count());
  samples_.y.assign(size, 0.0f);
  samples_.weight.assign(size, 0.0f);
  samples_.floor_answer.assign(size, 0.0f);
  const bool bounded = (block.saturated >> lane & 1u) != 0;
  samples_.at_least.assign(bounded ? size : 0, 0.0f);
  const float* const inverse_peak = inverse_peak_[block.phase].data() + lane;
  for (size_t k = 0; k < texture.sweeps.size(); ++k) {
    const size_t s = texture.sweeps[k];
    const auto first = static_cast<size_t>(texture.samples.sweeps[k].first);
    const float* samples = tile_.samples(block_index, s) + lane;
    const float* weights = tile_.weighted() ? tile_.weights(block_index, s) + lane : nullptr;
    const float* inverse = inverse_peak + (tile_.samples(0, s) - tile_.samples(0, 0));
    for (size_t i = 0; i < layout_.sweeps[s].r_px.size(); ++i) {
      samples_.y[first + i] = samples[i * kBlockLanes];
      const float weight = weights != nullptr ? weights[i * kBlockLanes] : 1.0f;
      samples_.weight[first + i] = std::max(weight, 0.0f);
      if (weight < 0.0f) samples_.at_least[first + i] = -weight;
      samples_.floor_answer[first + i] = inverse[i * kBlockLanes];
    }
  }
}

void StackSolver::free_floor(int block_index, int lane, int y) {
  const Block& block = blocks_[static_cast<size_t>(block_index)];
  const float above =
      block.baseline[static_cast<size_t>(lane)] - surroundings_.black(y, block.first_lane + lane);
  for (size_t i = 0; i < samples_.y.size(); ++i) samples_.y[i] += above * samples_.floor_answer[i];
  samples_.floor_weight = 1.0 / static_cast<double>(dark_noise_ * dark_noise_);
}

void StackSolver::load_areas(size_t t, int block_index, int lane, int y, const JointFit& fit) {
  const SweptMonitor& texture = textures_[t];
  const std::vector<AreaFrames>& areas = layout_.areas[static_cast<size_t>(texture.texture)];
  const int row_lane = blocks_[static_cast<size_t>(block_index)].first_lane + lane;
  const size_t index = stack_.sample_index(0, y, 0) + static_cast<size_t>(row_lane);
  const auto noise_sd = static_cast<double>(noise_sd_[static_cast<size_t>(row_lane)]);
  const double noise = std::pow(std::max(noise_sd, kMinStep), 2);
  // White is right for footprints of any shape: it counts more where the sweeps leave more than noise.
  const double residual = std::max(noise, fit.near_chi2 / std::max(fit.near_count, 1));
  const auto black = static_cast<double>(surroundings_.black(y, row_lane));
  const bool clipped = blocks_[static_cast<size_t>(block_index)].clipped[static_cast<size_t>(lane)];
  std::vector<LitShare> shares;
  for (const Footprint& mode : fit.modes) shares.emplace_back(mode, texture.extent);
  samples_.areas.clear();
  for (const AreaFrames& area : areas) {
    const MergedSample seen = merge(stack_, area.shot, index, noise_);
    AreaSample& sample = samples_.areas.emplace_back(AreaSample{.lit = area.lit,
                                                                .y = (seen.radiance - black) / area.light,
                                                                .weight = 0.0,
                                                                .floor_answer = 1.0 / area.light});
    const double own = noise_known_ ? seen.variance : noise / static_cast<double>(area.shot.size());
    double shape = 0.0, light = black + fit.floor;
    const bool dark = seen.radiance <= 0.0 && clipped;
    for (int m = 0; m < fit.modes.size(); ++m) {
      const Footprint& mode = fit.modes[m];
      shape += mode.weight * lit_share_error(mode, area.lit, texture.extent);
      if (dark || seen.saturated)
        light += area.light * mode.weight * shares[static_cast<size_t>(m)].of(area.lit).share;
    }
    if (seen.saturated && light >= seen.radiance) continue;  // it is at least that
    if (dark) {
      const double sd = std::sqrt(own);
      sample.y =
          (std::max(light, 0.0) + sd * mean_noise_below(std::max(light, 0.0) / sd) - black) / area.light;
    }
    const double model = area.lit.bars ? kBarsError * std::abs(sample.y) + shape : kWhiteError * sample.y;
    sample.weight = (area.lit.bars ? noise : residual) /
                    (std::max(own, 0.01 * noise) / (area.light * area.light) + model * model);
  }
}

StackSolver::Settled StackSolver::fit_sweeps(size_t t, int block_index, int lane, int y) {
  const SweptMonitor& texture = textures_[t];
  const Block& block = blocks_[static_cast<size_t>(block_index)];
  const int row_lane = block.first_lane + lane;
  const auto noise_sd = static_cast<double>(noise_sd_[static_cast<size_t>(row_lane)]);
  const std::optional<JointFit>& usual = usual_[t][static_cast<size_t>(block_index * kBlockLanes + lane)];
  Settled settled;
  load_samples(t, block_index, lane);
  if (usual && suffices(*usual, noise_sd)) {
    settled.fit = *usual;
  } else {
    settled.fit =
        find_footprints(samples_, peaks_of(t, block_index, lane), texture.extent, noise_sd, max_modes_,
                        workspace_, usual && needs_more(*usual, noise_sd) ? &*usual : nullptr);
  }
  settled.fit.floor =
      static_cast<double>(block.baseline[static_cast<size_t>(lane)] - surroundings_.black(y, row_lane));
  free_floor(block_index, lane, y);
  load_areas(t, block_index, lane, y, settled.fit);
  hold_against_white(t, noise_sd, settled);
  return settled;
}

std::optional<JointFit> StackSolver::fit_all(size_t t, int block, int lane, int y, const Footprints& start) {
  const auto weights = [&] {
    double sum = 0.0;
    for (const AreaSample& area : samples_.areas) sum += area.weight;
    return sum;
  };
  Footprints modes = start;
  for (int round = 0;; ++round) {
    // The first step changes most.
    const int iterations = round == 0 ? 1 : kPolish;
    const JointFit fit = fit_jointly(samples_, modes, textures_[t].extent, iterations, workspace_);
    if (!is_positive(fit)) return std::nullopt;
    const double before = weights();
    load_areas(t, block, lane, y, fit);
    // Narrower footprints trust fine bars more.
    if (round == kRounds || (fit.converged && std::abs(weights() - before) <= 0.2 * before))
      return fit.converged ? std::optional(fit) : std::nullopt;
    modes = fit.modes;
  }
}

void StackSolver::hold_against_white(size_t t, double noise_sd, Settled& settled) const {
  // Of light from all over the monitor, bars show half.
  std::vector<LitShare> shares;
  for (const Footprint& mode : settled.fit.modes) shares.emplace_back(mode, textures_[t].extent);
  double whole = 0.0, light = 0.0, rest = 0.0;
  for (const AreaSample& area : samples_.areas) {
    if (area.weight == 0.0) continue;
    const double share = area.lit.bars ? 0.5 : 1.0;
    double own = area.y - area.floor_answer * settled.fit.floor;
    light += area.weight * share * own;
    for (int m = 0; m < settled.fit.modes.size(); ++m)
      own -= settled.fit.modes[m].weight * shares[static_cast<size_t>(m)].of(area.lit).share;
    rest += area.weight * share * own;
    whole += area.weight * share * share;
  }
  settled.white_known = whole > 0.0;
  if (!settled.white_known) return;
  settled.white = light / whole;
  settled.rest = rest / whole;
  settled.rest_variance =
      std::pow(std::max(noise_sd, kMinStep), 2) / whole + std::pow(settled.fit.light_sd, 2);
}

bool StackSolver::neighbours_have_more(size_t t, size_t lane) const {
  const std::vector<Settled>& all = settled_[t];
  double rest = 0.0, variance = 0.0, light = 0.0;
  // Along the row, a mosaic has each of its colours at every other site.
  const int step = stack_.mosaic ? 2 : kChannels;
  for (int away = -kNeighbours; away <= kNeighbours; ++away) {
    const auto at = static_cast<std::ptrdiff_t>(lane) + away * step;
    if (at < 0 || at >= std::ssize(all) || !all[static_cast<size_t>(at)].white_known) continue;
    const Settled& own = all[static_cast<size_t>(at)];
    rest += own.rest;
    variance += own.rest_variance;
    light += std::abs(own.white);
  }
  return rest > kBeyondNoise * std::sqrt(variance) + kBarsError * light;
}

void StackSolver::settle(size_t t, int block, int lane, int y, bool expected, Settled& settled) {
  const auto noise_sd = static_cast<double>(
      noise_sd_[static_cast<size_t>(blocks_[static_cast<size_t>(block)].first_lane + lane)]);
  load_samples(t, block, lane);
  free_floor(block, lane, y);
  load_areas(t, block, lane, y, settled.fit);
  std::optional<JointFit> all = with_broad_light(t, block, lane, y, expected, settled);
  // What modes lack altogether they must not make up for.
  const bool lacking =
      settled.rest > kBeyondNoise * std::sqrt(settled.rest_variance) + kLacking * std::abs(settled.white);
  if (!all && !lacking && !settled.fit.modes.empty()) {
    load_areas(t, block, lane, y, settled.fit);
    all = fit_all(t, block, lane, y, settled.fit.modes);
  }
  const auto too_bright = [](const Footprint& mode) { return mode.weight > 1.0 + kBound; };
  if (!all && std::any_of(settled.fit.modes.begin(), settled.fit.modes.end(), too_bright)) {
    // Sweeps alone do not know of the bound.
    const JointFit bounded = fit_jointly(samples_, settled.fit.modes, textures_[t].extent, kLong, workspace_);
    if (is_positive(bounded)) all = bounded;
  }
  if (!all) return;
  settled.fit = *all;
  hold_against_white(t, noise_sd, settled);
}

std::optional<JointFit> StackSolver::with_broad_light(size_t t, int block, int lane, int y, bool expected,
                                                      const Settled& settled) {
  if (!settled.white_known || settled.fit.modes.size() >= max_modes_) return std::nullopt;
  const SweptMonitor& texture = textures_[t];
  const double noise =
      kMoreThanNoise * std::sqrt(settled.rest_variance) + kBarsError * std::abs(settled.white);
  if (settled.rest <= 0.0 || (!expected && settled.rest < noise)) return std::nullopt;
  const auto noise_sd = static_cast<double>(
      noise_sd_[static_cast<size_t>(blocks_[static_cast<size_t>(block)].first_lane + lane)]);
  const auto take = [&](const Footprints& modes) {
    rest_ = samples_;
    NormalEquations equations;
    rest_.floor_weight = INFINITY;
    evaluate(rest_, modes, texture.extent, workspace_, equations);
    rest_.y = workspace_.residual;
    rest_.floor_weight = samples_.floor_weight;
    for (size_t i = 0; i < rest_.areas.size(); ++i) rest_.areas[i].y = workspace_.areas[i].rest;
  };
  // Modes that took some of the broad light for their own give it back in turns.
  Footprints modes = settled.fit.modes;
  JointFit fit;
  for (int turn = 0; turn < kTurns; ++turn) {
    take(modes);
    const std::optional<BroadLight::Found> broad =
        texture.broad->find(rest_, noise_sd, expected, averaged_, workspace_);
    if (!broad) return std::nullopt;
    const Footprint& mode = broad->fit.modes[0];
    fit = broad->fit;
    if (modes.empty()) return fit;
    if (broad->shape || settled.rest > noise) {
      Footprints together = modes;
      together.push_back(mode);
      const std::optional<JointFit> all = fit_all(t, block, lane, y, together);
      if (all && texture.broad->is_broad(all->modes[all->modes.size() - 1])) return all;
    }
    take(broad->fit.modes);
    fit = fit_jointly(rest_, modes, texture.extent, kPolish, workspace_);
    if (!fit.converged || !is_positive(fit)) return std::nullopt;
    modes = fit.modes;
    const auto last = static_cast<size_t>(modes.size());
    fit.weight_sd[last] = broad->fit.weight_sd[0];
    fit.centre_sd_px[last] = broad->fit.centre_sd_px[0];
    fit.light_sd = std::hypot(fit.light_sd, broad->fit.light_sd);
    fit.modes.push_back(mode);
    if (settled.rest <= noise) break;
  }
  return fit;
}

void StackSolver::store(int block_index, int lane, int y, Matte& matte) const {
  const Block& block = blocks_[static_cast<size_t>(block_index)];
  const int row_lane = block.first_lane + lane, x = row_lane / pixel_lanes_;
  const int channel = channel_in(block.phase, lane);
  const auto noise_sd = static_cast<double>(noise_sd_[static_cast<size_t>(row_lane)]);
  std::uint8_t flags = matte.flags(x, y);
  if ((block.saturated >> lane & 1u) != 0) flags |= kFlagSaturated;
  std::vector<Mode> found;
  bool usable = false;
  double floor = 0.0;
  for (size_t t = 0; t < textures_.size(); ++t) {
    const Settled& settled = settled_[t][static_cast<size_t>(block_index * kBlockLanes + lane)];
    const JointFit& fit = settled.fit;
    floor += settled.fit.floor / static_cast<double>(textures_.size());
    double strongest = 0.0;
    for (int m = 0; m < fit.modes.size(); ++m) {
      const auto i = static_cast<size_t>(m);
      const Mode mode = mode_of(fit.modes[m], fit.weight_sd[i], fit.centre_sd_px[i], textures_[t].texture);
      if (!is_finite(mode)) {
        flags |= kFlagNotConverged;
        continue;
      }
      found.push_back(mode);
      strongest = std::max(strongest, fit.modes[m].weight);
      // No object sends more light than it gets.
      const double excess = fit.modes[m].weight - 1.0 - kBound;
      if (excess > 0.0 && !(excess < kBeyondNoise * fit.weight_sd[i] && std::isfinite(fit.weight_sd[i])))
        flags |= kFlagPoorFit;
    }
    if (!fit.modes.empty() && !fit.converged) flags |= kFlagNotConverged;
    const double rms = std::sqrt(fit.near_chi2 / std::max(fit.near_count, 1));
    if (rms > std::max(4.0 * noise_sd, 0.1 * strongest)) flags |= kFlagPoorFit;
    if (settled.white_known && std::abs(settled.rest) > kBeyondNoise * std::sqrt(settled.rest_variance) +
                                                            kBarsError * std::abs(settled.white))
      flags |= kFlagPoorFit;
    usable = usable || !fit.modes.empty() || has_samples(t, block_index, lane);
  }
  if (!usable) flags |= kFlagNoData;
  matte.foreground(x, y)[static_cast<size_t>(channel)] =
      surroundings_.black(y, row_lane) + static_cast<float>(floor);
  std::stable_sort(found.begin(), found.end(),
                   [](const Mode& a, const Mode& b) { return a.weight > b.weight; });
  const std::span<Mode> modes = matte.modes(x, y, channel);
  if (found.size() > modes.size()) flags |= kFlagPoorFit;
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
