#include "solver/gaussian/stack_solver.h"

#include <algorithm>
#include <cmath>

#include "core/footprint/within_pixel.h"
#include "solver/method/clipped_noise.h"

namespace glasswing {
namespace {

constexpr int kStretch = SampleTile::kMaxBlocks * kBlockLanes;
constexpr double kBoundSd = 0.02;  // by which a weight may be above 1
constexpr int kNeighbours = 4;     // each way, whose white says whether broad light is to be expected

// Whether a sweep's steps are so wide that a peak's second differences are as large as its height.
bool is_coarse(const SweepLayout& sweep) {
  const double length_px = sweep.r_px.back() - sweep.r_px.front();
  return length_px > 0.75 * sweep.sigma_px * static_cast<double>(sweep.r_px.size() - 1);
}

bool is_finite(const Mode& mode) {
  return std::isfinite(mode.weight + mode.x_px + mode.y_px + mode.xx_px2 + mode.xy_px2 + mode.yy_px2);
}

void forget_modes(int x, int y, Matte& matte) {
  matte.flags(x, y) &= static_cast<std::uint8_t>(~kFlagPoorFit);
  for (int c = 0; c < kChannels; ++c) std::ranges::fill(matte.modes(x, y, c), Mode{});
}

bool is_cut(const Footprints& modes, const MonitorExtent& extent) {
  return std::any_of(modes.begin(), modes.end(),
                     [&](const Footprint& mode) { return near_edge(mode, extent); });
}

std::vector<Peaks> peaks_of(const SweptMonitor& monitor, const PreparedBlock& block, int lane) {
  std::vector<Peaks> peaks;
  for (const size_t s : monitor.sweeps) peaks.push_back(block.peaks[s][lane]);
  return peaks;
}

// The fit of all samples, with its floor above black.
LaneFit lane_fit(const BatchFit& batch, const PreparedBlock& block, int lane) {
  const size_t l = lane;
  LaneFit fit{.fit = batch.all, .beyond = batch.beyond};
  fit.fit.floor += static_cast<double>(block.baseline[l] - block.black[l]);
  return fit;
}

bool any_peak(const std::vector<Peaks>& peaks) {
  return std::ranges::any_of(peaks, [](const Peaks& sweep) { return sweep.count > 0; });
}

}  // namespace

StackSolver::StackSolver(const FrameStack& stack, const StackLayout& layout,
                         const std::vector<SweptMonitor>& monitors, int max_modes,
                         double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      monitors_(monitors),
      max_modes_(max_modes),
      pixel_lanes_(stack.samples_per_pixel()),
      lane_count_(stack.width_px * pixel_lanes_),
      surroundings_(stack, layout.stage, silhouette_tolerance),
      noise_known_(surroundings_.noise_known()),
      coarse_(std::ranges::any_of(layout.sweeps, is_coarse)),
      noise_(surroundings_.noise()),
      tile_(layout),
      preparer_(layout, monitors, noise_, noise_known_,
                [this](int phase, int lane) { return channel_in(phase, lane); }) {
  for (const SweptMonitor& monitor : monitors) lane_solvers_.emplace_back(monitor, max_modes);
  noise_sd_.resize(lane_count_);
  to_solve_.resize(stack.width_px);
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
      const std::array<float, kBlockLanes> cut_off = tile_.cut_off(block);
      for (int lane = 0; lane < std::min(kBlockLanes, count - block * kBlockLanes); ++lane) {
        const auto at = static_cast<size_t>(first + block * kBlockLanes + lane),
                   l = static_cast<size_t>(lane);
        noise_sd_[at] = sum[l] * sd_before_clipping(cut_off[l]) /
                        (preparer_.dark_noise() * static_cast<float>(layout_.sweeps.size()));
      }
    }
  }
}

std::vector<double> StackSolver::read_noise() const {
  std::vector<double> read_sd(to_solve_.size());
  for (size_t x = 0; x < read_sd.size(); ++x) {
    double variance = 0.0;
    const size_t lanes = pixel_lanes_;
    for (size_t lane = x * lanes; lane < (x + 1) * lanes; ++lane) {
      const double sd = noise_sd_[lane];
      variance += sd * sd / pixel_lanes_;
    }
    read_sd[x] = std::sqrt(std::max(variance, kMinStep * kMinStep));
  }
  return read_sd;
}

void StackSolver::settle_row(int y, Matte& matte) {
  if (noise_known_) {
    for (int lane = 0; lane < lane_count_; ++lane) {
      noise_sd_[lane] =
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
}

void StackSolver::solve_row(int y, Matte& matte) {
  settle_row(y, matte);
  for (int first = 0; first < lane_count_; first += kStretch) {
    const int count = std::min(kStretch, lane_count_ - first);
    const auto begin = to_solve_.begin() + first / pixel_lanes_,
               end = to_solve_.begin() + (first + count - 1) / pixel_lanes_ + 1;
    if (std::find(begin, end, true) == end) continue;
    Tile tile = prepare(y, first, count);
    for (size_t monitor = 0; monitor < monitors_.size(); ++monitor) {
      fit_batches(monitor, tile);
      fit_lanes(monitor, tile);
    }
    for (int block = 0; block < std::ssize(tile.blocks); ++block) {
      for (int lane = 0; lane < kBlockLanes; ++lane) {
        if (tile.blocks[block].solves(lane)) store(tile, block, lane, y, matte);
      }
    }
  }
}

StackSolver::Tile StackSolver::prepare(int y, int first, int count) {
  Tile tile;
  tile_.load(stack_, y, first, count, noise_);
  if (preparer_.needs_weights()) tile_.need_weights();
  for (int block = 0; block < tile_.block_count(); ++block) {
    BlockStart start{.first_lane = first + block * kBlockLanes,
                     .phase = phase_of(first + block * kBlockLanes, y)};
    PreparedBlock::Lanes one{};
    int lanes = 0;
    for (int lane = 0; lane < kBlockLanes && start.first_lane + lane < lane_count_; ++lane, ++lanes) {
      const int row_lane = start.first_lane + lane;
      const size_t l = lane;
      if (!to_solve_[row_lane / pixel_lanes_]) continue;
      start.lanes |= 1u << lane;
      start.black[l] = surroundings_.black(y, row_lane);
      start.noise_sd[l] = noise_sd_[row_lane];
      if (!noise_known_)
        one[l] = std::max(start.noise_sd[l] * start.noise_sd[l], static_cast<float>(kMinStep * kMinStep));
    }
    const PreparedBlock& own = tile.blocks.emplace_back(preparer_.prepare(start, tile_, block));
    if (own.lanes != 0) tile_.load_areas(stack_, y, block, start.first_lane, lanes, noise_, one, own.clipped);
  }
  const size_t lanes = tile.blocks.size() * kBlockLanes;
  tile.batch.assign(monitors_.size(), std::vector<BatchFit>(lanes));
  tile.batched.assign(monitors_.size(), std::vector<bool>(lanes));
  tile.fits.assign(monitors_.size(), std::vector<LaneFit>(lanes));
  return tile;
}

BatchPixel StackSolver::batch_pixel(size_t m, const Tile& tile, int block_index, int lane) const {
  const SweptMonitor& monitor = monitors_[m];
  const PreparedBlock& block = tile.blocks[block_index];
  const size_t l = lane;
  BatchPixel pixel;
  for (size_t k = 0; k < monitor.sweeps.size(); ++k) {
    const float* const samples = tile_.samples(block_index, monitor.sweeps[k]);
    pixel.y[k] = samples + lane;
    if (tile_.weighted()) pixel.weight[k] = tile_.weights(block_index, monitor.sweeps[k]) + lane;
    if (!preparer_.unit_peaks())
      pixel.floor_answer[k] =
          preparer_.inverse_peak(block.phase) + (samples - tile_.samples(block_index, 0)) + lane;
  }
  const double noise_sd = std::max(static_cast<double>(block.noise_sd[l]), kMinStep),
               dark = preparer_.dark_noise();
  pixel.noise_sd = noise_sd;
  pixel.floor_weight = 1.0 / (dark * dark);
  pixel.black = static_cast<double>(block.black[l] - block.baseline[l]);
  pixel.floor_squares = static_cast<double>(block.floor[m].squares[l]);
  pixel.floor_products = static_cast<double>(block.floor[m].products[l]);
  pixel.bound_weight = std::pow(noise_sd / kBoundSd, 2);
  pixel.area = tile_.areas(block_index, static_cast<size_t>(monitor.texture)) + lane;
  pixel.area_variance = tile_.area_variances(block_index, static_cast<size_t>(monitor.texture)) + lane;
  pixel.baseline = static_cast<double>(block.baseline[l]);
  return pixel;
}

void StackSolver::fit_batches(size_t m, Tile& tile) const {
  const SweptMonitor& monitor = monitors_[m];
  if (monitor.sweeps.size() > BatchPixel::kMaxSweeps) return;
  std::array<std::vector<BatchPixel>, kMaxFootprints + 1> batches;  // by count of modes
  std::array<std::vector<size_t>, kMaxFootprints + 1> places;
  for (int block = 0; block < std::ssize(tile.blocks); ++block) {
    const PreparedBlock& own = tile.blocks[block];
    for (int lane = 0; lane < kBlockLanes; ++lane) {
      // Bounds and edges are for fit_jointly.
      if (!own.solves(lane) || own.is_bounded(lane)) continue;
      BatchPixel pixel = batch_pixel(m, tile, block, lane);
      bool saturated = false;
      for (size_t a = 0; a < monitor.areas.size(); ++a)
        saturated = saturated || std::isinf(pixel.area_variance[a * kBlockLanes]);
      const std::vector<Peaks> peaks = peaks_of(monitor, own, lane);
      pixel.start = usual_start(monitor.samples, peaks, max_modes_);
      if (saturated || (pixel.start.empty() && any_peak(peaks)) || is_cut(pixel.start, monitor.extent))
        continue;
      const size_t batch = pixel.start.size();
      batches[batch].push_back(pixel);
      places[batch].push_back(place(block, lane));
    }
  }
  std::vector<BatchFit> fits;
  for (size_t batch = 0; batch < batches.size(); ++batch) {
    fits.assign(batches[batch].size(), {});
    fit_batch({.layout = monitor.samples, .stride = kBlockLanes, .areas = monitor.areas}, batches[batch],
              fits);
    for (size_t i = 0; i < fits.size(); ++i) {
      if (is_cut(fits[i].sweeps.modes, monitor.extent) || is_cut(fits[i].all.modes, monitor.extent)) continue;
      if (monitor.areas.empty()) fits[i].all = fits[i].sweeps;
      tile.batch[m][places[batch][i]] = fits[i];
      tile.batched[m][places[batch][i]] = true;
    }
  }
}

LaneSamples StackSolver::lane_samples(size_t m, const PreparedBlock& block, int block_index, int lane) const {
  const SweptMonitor& monitor = monitors_[m];
  const size_t l = lane;
  const double dark = preparer_.dark_noise();
  LaneSamples lane_samples{.sweeps = {.layout = &monitor.samples, .y = {}, .weight = {}},
                           .peaks = peaks_of(monitor, block, lane),
                           .area = {},
                           .area_variance = {},
                           .noise_sd = block.noise_sd[l],
                           .black = block.black[l],
                           .baseline = block.baseline[l],
                           .floor_weight = 1.0 / (dark * dark)};
  PixelSamples& to = lane_samples.sweeps;
  to.bound_weight = std::pow(std::max(lane_samples.noise_sd, kMinStep) / kBoundSd, 2);
  to.width_weight = kWidthWeight * std::pow(std::max(lane_samples.noise_sd, kMinNoise), 2);
  const size_t size = monitor.samples.padded_count();
  to.y.assign(size, 0.0f);
  to.weight.assign(size, 0.0f);
  to.floor_answer.assign(size, 0.0f);
  to.at_least.assign(block.is_bounded(lane) ? size : 0, 0.0f);
  for (size_t k = 0; k < monitor.sweeps.size(); ++k) {
    const size_t s = monitor.sweeps[k];
    const size_t first = monitor.samples.sweeps[k].first;
    const float* const samples = tile_.samples(block_index, s) + lane;
    const float* const weights = tile_.weighted() ? tile_.weights(block_index, s) + lane : nullptr;
    const float* const inverse =
        preparer_.inverse_peak(block.phase) + (samples - tile_.samples(block_index, 0));
    for (size_t i = 0; i < layout_.sweeps[s].r_px.size(); ++i) {
      to.y[first + i] = samples[i * kBlockLanes];
      const float weight = weights != nullptr ? weights[i * kBlockLanes] : 1.0f;
      to.weight[first + i] = std::max(weight, 0.0f);
      if (weight < 0.0f) to.at_least[first + i] = -weight;
      to.floor_answer[first + i] = inverse[i * kBlockLanes];
    }
  }
  const size_t texture = monitor.texture;
  for (size_t a = 0; a < monitor.areas.size(); ++a) {
    lane_samples.area.push_back(static_cast<double>(tile_.areas(block_index, texture)[a * kBlockLanes + l]));
    lane_samples.area_variance.push_back(
        static_cast<double>(tile_.area_variances(block_index, texture)[a * kBlockLanes + l]));
  }
  return lane_samples;
}

void StackSolver::fit_lanes(size_t m, Tile& tile) {
  const auto for_lanes = [&](auto each) {
    for (int block = 0; block < std::ssize(tile.blocks); ++block) {
      const PreparedBlock& own = tile.blocks[block];
      for (int lane = 0; lane < kBlockLanes; ++lane) {
        if (own.solves(lane)) each(own, block, lane, place(block, lane));
      }
    }
  };
  std::vector<WhiteRest> beyond(tile.fits[m].size());
  std::vector<bool> searched(beyond.size());
  for_lanes([&](const PreparedBlock& own, int block, int lane, size_t at) {
    const BatchFit* const batch = tile.batched[m][at] ? &tile.batch[m][at] : nullptr;
    const double noise_sd = own.noise_sd[lane];
    if (batch == nullptr || !is_done(*batch, noise_sd)) {
      tile.fits[m][at] = lane_solvers_[m].search(lane_samples(m, own, block, lane), batch);
      searched[at] = true;
      beyond[at] = tile.fits[m][at].beyond;
      return;
    }
    tile.fits[m][at] = lane_fit(*batch, own, lane);
    beyond[at] = batch->beyond;
  });
  for_lanes([&](const PreparedBlock& own, int block, int lane, size_t at) {
    const bool expected = neighbours_have_more(beyond, at);
    if (!searched[at] && !expected) return;
    const LaneSamples samples = lane_samples(m, own, block, lane);
    LaneSolver& solver = lane_solvers_[m];
    if (!searched[at]) tile.fits[m][at] = solver.search(samples, &tile.batch[m][at]);
    tile.fits[m][at] = solver.judge(samples, solver.settle(samples, tile.fits[m][at], expected));
  });
}

bool StackSolver::neighbours_have_more(const std::vector<WhiteRest>& beyond, size_t lane) const {
  double rest = 0.0, variance = 0.0, light = 0.0;
  // Along the row, a mosaic has each of its colours at every other site.
  const int step = stack_.mosaic ? 2 : kChannels;
  for (int away = -kNeighbours; away <= kNeighbours; ++away) {
    const auto at = static_cast<std::ptrdiff_t>(lane) + away * step;
    if (at < 0 || at >= std::ssize(beyond) || !beyond[at].known) continue;
    const WhiteRest& own = beyond[at];
    rest += own.rest;
    variance += own.variance;
    light += std::abs(own.white);
  }
  return rest > kBeyondNoise * std::sqrt(variance) + kBarsError * light;
}

void StackSolver::store(const Tile& tile, int block_index, int lane, int y, Matte& matte) const {
  const PreparedBlock& block = tile.blocks[block_index];
  const int row_lane = block.first_lane + lane, x = row_lane / pixel_lanes_;
  const int channel = channel_in(block.phase, lane);
  const double noise_sd = block.noise_sd[lane];
  std::uint8_t flags = matte.flags(x, y);
  if (block.is_bounded(lane)) flags |= kFlagSaturated;
  std::vector<Mode> found;
  bool usable = false;
  double floor = 0.0;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    const LaneFit& own = tile.fits[m][place(block_index, lane)];
    const JointFit& fit = own.fit;
    floor += fit.floor / static_cast<double>(monitors_.size());
    for (int k = 0; k < fit.modes.size(); ++k) {
      const size_t i = k;
      if (fit.modes[k].weight == 0.0) continue;
      const double centre_sd_px = std::hypot(fit.centre_sd_px[i], shape_error_px(fit.modes[k]));
      const Mode mode = mode_of(fit.modes[k], fit.weight_sd[i], centre_sd_px, monitors_[m].texture);
      if (!is_finite(mode)) {
        flags |= kFlagNotConverged;
        continue;
      }
      found.push_back(mode);
      // No object sends more light than it gets.
      const double excess = fit.modes[k].weight - kMaxWeight;
      if (excess > 0.0 && !(excess < kBeyondNoise * fit.weight_sd[i] && std::isfinite(fit.weight_sd[i])))
        flags |= kFlagPoorFit;
    }
    if (!fit.modes.empty() && !fit.converged) flags |= kFlagNotConverged;
    const SampleLayout& samples = monitors_[m].samples;
    if (unexplained(own, noise_sd, samples) > 0.0 || contradicts_white(own.beyond) ||
        is_of_another_shape(fit.modes, samples))
      flags |= kFlagPoorFit;
    usable = usable || !fit.modes.empty() || has_samples(m, block_index, lane);
  }
  if (!usable) flags |= kFlagNoData;
  matte.foreground(x, y)[channel] = block.black[lane] + static_cast<float>(floor);
  std::stable_sort(found.begin(), found.end(),
                   [](const Mode& a, const Mode& b) { return a.weight > b.weight; });
  const std::span<Mode> modes = matte.modes(x, y, channel);
  if (found.size() > modes.size()) flags |= kFlagPoorFit;
  std::copy_n(found.begin(), std::min(found.size(), modes.size()), modes.begin());
  matte.flags(x, y) = flags;
}

bool StackSolver::has_samples(size_t m, int block, int lane) const {
  if (!tile_.weighted()) return true;
  for (const size_t s : monitors_[m].sweeps) {
    const float* weights = tile_.weights(block, s) + lane;
    for (size_t i = 0; i < layout_.sweeps[s].r_px.size(); ++i) {
      if (weights[i * kBlockLanes] > 0.0f) return true;
    }
  }
  return false;
}

std::vector<StackSolver::Explained> StackSolver::explain(int x, int y) {
  std::vector<Explained> lanes;
  Matte matte = blank_matte(stack_, {}, kMaxModes);
  settle_row(y, matte);
  if (!to_solve_[x]) return lanes;
  const int first = x * pixel_lanes_ / kStretch * kStretch;
  Tile tile = prepare(y, first, std::min(kStretch, lane_count_ - first));
  for (size_t m = 0; m < monitors_.size(); ++m) fit_batches(m, tile);
  for (int row_lane = x * pixel_lanes_; row_lane < (x + 1) * pixel_lanes_; ++row_lane) {
    // A pixel may continue in the next stretch.
    if (row_lane - first >= kStretch) break;
    const int block = (row_lane - first) / kBlockLanes, lane = (row_lane - first) % kBlockLanes;
    const PreparedBlock& own = tile.blocks[block];
    Explained& explained = lanes.emplace_back();
    explained.channel = channel_in(own.phase, lane);
    for (size_t m = 0; m < monitors_.size(); ++m) {
      LaneNotes& notes = explained.notes.emplace_back();
      const LaneSamples& samples = explained.samples.emplace_back(lane_samples(m, own, block, lane));
      const BatchFit* const batch =
          tile.batched[m][place(block, lane)] ? &tile.batch[m][place(block, lane)] : nullptr;
      LaneFit& fit = explained.fits.emplace_back();
      if (batch != nullptr && is_done(*batch, samples.noise_sd)) {
        notes.emplace_back("the batch explains all samples");
        fit = lane_fit(*batch, own, lane);
        continue;
      }
      LaneSolver& solver = lane_solvers_[m];
      fit = solver.judge(
          samples, solver.settle(samples, solver.search(samples, batch, &notes), false, &notes), &notes);
    }
  }
  return lanes;
}

}  // namespace glasswing
