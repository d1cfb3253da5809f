#include "solver/hierarchical/box_solver.h"

#include <algorithm>
#include <cmath>

#include "solver/method/exposure_merge.h"
#include "solver/method/sample_noise.h"

namespace glasswing {
namespace {

// In units of the noise and of the strongest weight: a residual above both is a poor fit.
constexpr double kPoorNoise = 4.0, kPoorShare = 0.05;
constexpr size_t kMinSums = 4;

// The box as which a background point's footprint is stored.
Interval straight_side(const AxisFit& fit) {
  const double half_px = 0.5 * std::sqrt(12.0) * fit.sigma_px;
  return {.low_px = fit.centre_px - half_px, .high_px = fit.centre_px + half_px};
}

// Its part on the monitor, at least of the minimum length.
Interval inside(const Interval& side, double extent_px) {
  constexpr double kMin = WaveAxis::kMinLength_px;
  const double low_px = std::clamp(side.low_px, 0.0, extent_px - kMin);
  return {.low_px = low_px, .high_px = std::clamp(side.high_px, low_px + kMin, extent_px)};
}

}  // namespace

BoxSolver::BoxSolver(const FrameStack& stack, const BoxLayout& layout, bool partial_cover,
                     double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      partial_cover_(partial_cover),
      width_(stack.width_px),
      surroundings_(stack, layout.stage, silhouette_tolerance),
      fitter_(layout.monitors),
      samples_(layout.monitors.size()) {
  for (size_t m = 0; m < layout.monitors.size(); ++m) {
    samples_[m].resize(layout.monitors[m].patterns.size());
    pixel_.samples.emplace_back(layout.monitors[m].patterns.size());
  }
}

std::vector<BoxSolver::Sample> BoxSolver::load(int y, const Shot& shot) const {
  std::vector<Sample> row(static_cast<size_t>(width_) * kChannels);
  const size_t first = stack_.sample_index(0, y, 0);
  for (size_t lane = 0; lane < row.size(); ++lane) {
    const MergedSample merged = merge(stack_, shot, first + lane, surroundings_.noise());
    row[lane] = {.radiance = static_cast<float>(merged.radiance),
                 .variance = static_cast<float>(merged.variance),
                 .saturated = merged.saturated};
  }
  return row;
}

void BoxSolver::load_row(int y) {
  if (!layout_.stage.black.empty()) black_ = load(y, layout_.stage.black);
  for (size_t m = 0; m < layout_.monitors.size(); ++m) {
    for (size_t p = 0; p < samples_[m].size(); ++p)
      samples_[m][p] = load(y, layout_.monitors[m].patterns[p].shot);
  }
}

std::vector<double> BoxSolver::estimate_noise() const {
  const double least = sample_noise(layout_.stage.camera, 0.0).read_sd;  // quantisation
  std::vector<double> sd(static_cast<size_t>(width_), 0.0);
  for (size_t x = 0; x < sd.size(); ++x) {
    double squares = 0.0, degrees = 0.0;
    for (size_t m = 0; m < samples_.size(); ++m) {
      const std::vector<BoxPattern>& patterns = layout_.monitors[m].patterns;
      for (size_t c = 0; c < kChannels; ++c) {
        const size_t lane = x * kChannels + c;
        double count = 0.0, mean = 0.0, spread = 0.0;  // of the sums, by Welford's recurrence
        for (size_t p = 0; p + 1 < patterns.size(); ++p) {
          const BoxPattern &own = patterns[p], &next = patterns[p + 1];
          const Sample &a = samples_[m][p][lane], &b = samples_[m][p + 1][lane];
          const bool pair = own.axis != BoxPattern::kSolid && own.axis == next.axis && own.wave == next.wave;
          if (!pair || a.saturated || b.saturated || own.light != patterns.back().light) continue;
          const double sum = static_cast<double>(a.radiance + b.radiance), off = sum - mean;
          count += 1.0;
          mean += off / count;
          spread += off * (sum - mean);
        }
        if (count < kMinSums) continue;
        squares += 0.5 * spread;
        degrees += count - 1.0;
      }
    }
    sd[x] = degrees > 0.0 ? std::max(std::sqrt(squares / degrees), least) : surroundings_.noise().read_sd;
  }
  return sd;
}

bool BoxSolver::gather(int x, double noise_factor) {
  bool saturated = false;
  const auto fill = [&](const std::vector<Sample>& row, BoxSample& to) {
    for (size_t c = 0; c < kChannels; ++c) {
      const Sample& from = row[static_cast<size_t>(x) * kChannels + c];
      const double variance = std::max(static_cast<double>(from.variance) * noise_factor, 1e-12);
      saturated = saturated || from.saturated;
      to.radiance[c] = static_cast<double>(from.radiance);
      to.information[c] = from.saturated ? 0.0 : 1.0 / variance;
      to.straight[c] = 0.0;
    }
  };
  if (!black_.empty()) fill(black_, pixel_.black);
  for (size_t m = 0; m < samples_.size(); ++m) {
    for (size_t p = 0; p < samples_[m].size(); ++p) fill(samples_[m][p], pixel_.samples[m][p]);
  }
  pixel_.has_straight = false;
  return saturated;
}

// Adds what the background's box sees of each pattern.
void BoxSolver::add_straight(std::span<const BackgroundPoint> background) {
  std::array<double, WaveAxis::kMaxWaves> v;
  for (size_t m = 0; m < layout_.monitors.size(); ++m) {
    const BoxMonitor& monitor = layout_.monitors[m];
    const BackgroundPoint& point = background[static_cast<size_t>(monitor.texture)];
    if (!point.seen) continue;
    pixel_.has_straight = true;
    const std::array<double, 2> extent_px{static_cast<double>(monitor.width_px),
                                          static_cast<double>(monitor.height_px)};
    double share = 1.0;
    std::array<Interval, 2> sides;
    for (size_t a = 0; a < 2; ++a) {
      const Interval whole = straight_side(point.axis[a]);
      sides[a] = inside(whole, extent_px[a]);
      share *= std::min(sides[a].length_px() / std::max(whole.length_px(), WaveAxis::kMinLength_px), 1.0);
    }
    for (size_t a = 0; a < 2; ++a) {
      fitter_.axis(m, a).means(sides[a], v);
      for (size_t p = 0; p < monitor.patterns.size(); ++p) {
        const BoxPattern& pattern = monitor.patterns[p];
        const bool solid = pattern.axis == BoxPattern::kSolid;
        if (!solid && pattern.axis != static_cast<int>(a)) continue;
        const double lit = solid ? 1.0 : 0.5 * (1.0 + pattern.sign * v[pattern.wave]);
        for (size_t c = 0; c < kChannels; ++c)
          pixel_.samples[m][p].straight[c] = share * point.weight[c] * pattern.light[c] * lit;
      }
    }
  }
}

void BoxSolver::solve_row(int y, Matte& matte) {
  load_row(y);
  const bool known = surroundings_.noise_known();
  const std::vector<double> noise = known ? std::vector<double>() : estimate_noise();
  const std::vector<bool> object = surroundings_.settle_row(y, noise, matte).object;
  const double usual_variance = surroundings_.noise().variance(0.0);
  for (int x = 0; x < width_; ++x) {
    if (!object[static_cast<size_t>(x)]) continue;
    const double noise_sd = known ? std::sqrt(usual_variance) : noise[static_cast<size_t>(x)];
    if (gather(x, noise_sd * noise_sd / usual_variance)) matte.flags(x, y) |= kFlagSaturated;
    std::span<const BackgroundPoint> background;
    if (partial_cover_) {
      background = surroundings_.background(x, y);
      add_straight(background);
    }
    write(x, y, background, fitter_.fit(pixel_), noise_sd, matte);
  }
}

void BoxSolver::write(int x, int y, std::span<const BackgroundPoint> background, const BoxFit& fit,
                      double noise_sd, Matte& matte) const {
  double strongest = 0.0;
  std::vector<std::array<Mode, kChannels>> found;
  const auto variance = [](const Interval& side) {
    return static_cast<float>(side.length_px() * side.length_px() / 12.0);
  };
  for (size_t m = 0; m < fit.boxes.size(); ++m) {
    const PixelBox& box = fit.boxes[m];
    if (!box.seen) continue;
    std::array<Mode, kChannels>& modes = found.emplace_back();
    for (size_t c = 0; c < kChannels; ++c) {
      strongest = std::max(strongest, box.weight[c]);
      modes[c] = {.weight = static_cast<float>(box.weight[c]),
                  .x_px = static_cast<float>(box.side[0].centre_px()),
                  .y_px = static_cast<float>(box.side[1].centre_px()),
                  .xx_px2 = variance(box.side[0]),
                  .xy_px2 = 0.0f,
                  .yy_px2 = variance(box.side[1]),
                  .texture = layout_.monitors[m].texture,
                  .weight_sd = static_cast<float>(box.weight_sd[c]),
                  .centre_sd_px = static_cast<float>(box.centre_sd_px)};
    }
  }
  if (fit.straight > 0.0) {
    for (const BoxMonitor& monitor : layout_.monitors) {
      const BackgroundPoint& point = background[static_cast<size_t>(monitor.texture)];
      if (!point.seen) continue;
      std::array<Mode, kChannels>& modes = found.emplace_back();
      for (int c = 0; c < kChannels; ++c) {
        Mode& mode = modes[static_cast<size_t>(c)] = point.mode(c, monitor.texture);
        mode.weight *= static_cast<float>(fit.straight);
      }
    }
  }
  for (int c = 0; c < kChannels; ++c) {
    const auto channel = static_cast<size_t>(c);
    matte.foreground(x, y)[channel] = static_cast<float>(fit.foreground[channel]);
    std::ranges::stable_sort(found, std::ranges::greater(),
                             [&](const auto& modes) { return modes[channel].weight; });
    const std::span<Mode> modes = matte.modes(x, y, c);
    for (size_t i = 0; i < std::min(found.size(), modes.size()); ++i) {
      if (found[i][channel].weight > 0.0f) modes[i] = found[i][channel];
    }
  }
  matte.coverage(x, y) = static_cast<float>(1.0 - fit.straight);
  std::uint8_t& flags = matte.flags(x, y);
  if (fit.sample_count == 0) flags |= kFlagNoData;
  if (fit.rms > std::max(kPoorNoise * noise_sd, kPoorShare * strongest)) flags |= kFlagPoorFit;
}

}  // namespace glasswing
