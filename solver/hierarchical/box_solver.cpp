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
// Pixels of a row whose fits tell its noise.
constexpr size_t kFewestFits = 8, kMostFits = 64;
constexpr float kCorrection = 0.25f;  // of a change of brightness that is not corrected

// How many halos of each monitor a matte's modes leave room for.
size_t halo_count(size_t monitors, bool partial_cover) {
  const size_t others = partial_cover ? 2 * monitors : monitors;
  return others < kMaxModes ? std::min((kMaxModes - others) / monitors, kMaxHalos) : 0;
}

// The box as which a background point's footprint is stored.
Interval straight_side(const AxisFit& fit) {
  const double half_px = 0.5 * std::sqrt(12.0) * fit.sigma_px;
  return {.low_px = fit.centre_px - half_px, .high_px = fit.centre_px + half_px};
}

bool shows_complements(const BoxMonitor& monitor) {
  return std::ranges::any_of(monitor.patterns, [](const BoxPattern& pattern) { return pattern.sign < 0.0; });
}

}  // namespace

int modes_needed(int monitors, bool partial_cover) {
  const size_t count = monitors;
  const size_t others = partial_cover ? 2 * count : count;
  return static_cast<int>(std::min<size_t>(others + count * halo_count(count, partial_cover), kMaxModes));
}

BoxSolver::BoxSolver(const FrameStack& stack, const BoxLayout& layout, bool partial_cover,
                     double silhouette_tolerance)
    : stack_(stack),
      layout_(layout),
      partial_cover_(partial_cover),
      has_complements_(std::ranges::any_of(layout.monitors, shows_complements)),
      width_(stack.width_px),
      surroundings_(stack, layout.stage, silhouette_tolerance),
      fitter_(layout.monitors, halo_count(layout.monitors.size(), partial_cover)),
      samples_(layout.monitors.size()) {
  for (size_t m = 0; m < layout.monitors.size(); ++m) {
    samples_[m].resize(layout.monitors[m].patterns.size());
    pixel_.samples.emplace_back(layout.monitors[m].patterns.size());
  }
}

void BoxSolver::load(int y, const Shot& shot, std::vector<Sample>& row) const {
  row.resize(static_cast<size_t>(width_) * kChannels);
  const size_t first = stack_.sample_index(0, y, 0);
  for (size_t lane = 0; lane < row.size(); ++lane) {
    const MergedSample merged = merge(stack_, shot, first + lane, surroundings_.noise());
    row[lane] = {.radiance = static_cast<float>(merged.radiance),
                 .variance = static_cast<float>(merged.variance),
                 .saturated = merged.saturated};
    if (!stack_.brightness.empty()) {
      // What was corrected is not exact.
      const float change = 1.0f - stack_.brightness[shot.front().frame][lane % kChannels];
      row[lane].variance += std::pow(kCorrection * change * row[lane].radiance, 2.0f);
    }
  }
}

void BoxSolver::load_row(int y) {
  if (!layout_.stage.black.empty()) load(y, layout_.stage.black, black_);
  for (size_t m = 0; m < layout_.monitors.size(); ++m) {
    for (size_t p = 0; p < samples_[m].size(); ++p)
      load(y, layout_.monitors[m].patterns[p].shot, samples_[m][p]);
  }
}

std::vector<double> BoxSolver::estimate_noise() const {
  const double least = sample_noise(layout_.stage.camera, 0.0).read_sd;  // quantisation
  std::vector<double> sd(width_, 0.0);
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

double BoxSolver::estimate_noise_by_fits(const std::vector<bool>& object) {
  const size_t count = std::ranges::count(object, true);
  const size_t step = std::max<size_t>(count / kMostFits, 1);
  std::vector<double> leftovers;
  for (size_t x = 0, i = 0; x < object.size(); ++x) {
    if (!object[x] || i++ % step != 0) continue;
    gather(static_cast<int>(x), 1.0);
    if (const std::optional<double> own = fitter_.leftover(pixel_)) leftovers.push_back(*own);
  }
  const double usual = std::sqrt(surroundings_.noise().variance(0.0));
  if (leftovers.size() < kFewestFits) return usual;
  // Not the median: most of a row may look at several places, which noise does not explain.
  const auto quarter = leftovers.begin() + leftovers.size() / 4;
  std::ranges::nth_element(leftovers, quarter);
  return std::max(usual * std::sqrt(*quarter), sample_noise(layout_.stage.camera, 0.0).read_sd);
}

bool BoxSolver::gather(int x, double noise_factor) {
  bool saturated = false, gray = true;
  saturated_light_ = {};
  Samples3 information{};
  const auto fill = [&](const std::vector<Sample>& row, BoxSample& to) {
    for (size_t c = 0; c < kChannels; ++c) {
      const Sample& from = row[static_cast<size_t>(x) * kChannels + c];
      const double variance = std::max(from.variance * noise_factor, 1e-12);
      saturated = saturated || from.saturated;
      to.radiance[c] = static_cast<double>(from.radiance);
      to.information[c] = from.saturated ? 0.0 : 1.0 / variance;
      to.straight[c] = 0.0;
      information[c] += to.information[c];
      if (from.saturated) saturated_light_[c] = std::max(saturated_light_[c], to.radiance[c]);
      gray = gray && to.radiance[c] == to.radiance[0];
    }
  };
  if (!black_.empty()) fill(black_, pixel_.black);
  for (size_t m = 0; m < samples_.size(); ++m) {
    for (size_t p = 0; p < samples_[m].size(); ++p) fill(samples_[m][p], pixel_.samples[m][p]);
  }
  for (size_t c = 0; c < kChannels; ++c) {
    if (information[c] > 0.0) saturated_light_[c] = 0.0;
  }
  if (gray) {
    const auto first_only = [](BoxSample& sample) { sample.information[1] = sample.information[2] = 0.0; };
    first_only(pixel_.black);
    for (std::vector<BoxSample>& samples : pixel_.samples) std::ranges::for_each(samples, first_only);
  }
  pixel_.gray = gray;
  pixel_.has_straight = false;
  return saturated;
}

// Adds what the background's box sees of each pattern.
void BoxSolver::add_straight(std::span<const BackgroundPoint> background) {
  std::array<double, WaveAxis::kMaxWaves> v;
  for (size_t m = 0; m < layout_.monitors.size(); ++m) {
    const BoxMonitor& monitor = layout_.monitors[m];
    const BackgroundPoint& point = background[monitor.texture];
    if (!point.seen) continue;
    pixel_.has_straight = true;
    double share = 1.0;
    std::array<Interval, 2> sides;
    for (size_t a = 0; a < 2; ++a) {
      const Interval whole = straight_side(point.axis[a]);
      sides[a] = inside(whole, extent_px(monitor, a));
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
  std::vector<double> noise = known ? std::vector<double>() : estimate_noise();
  const std::vector<bool> object = surroundings_.settle_row(y, noise, matte).object;
  if (!known && !has_complements_) std::ranges::fill(noise, estimate_noise_by_fits(object));
  const double usual_variance = surroundings_.noise().variance(0.0);
  for (int x = 0; x < width_; ++x) {
    if (!object[x]) continue;
    const double noise_sd = known ? std::sqrt(usual_variance) : noise[x];
    if (gather(x, noise_sd * noise_sd / usual_variance)) matte.flags(x, y) |= kFlagSaturated;
    std::span<const BackgroundPoint> background;
    if (partial_cover_) {
      background = surroundings_.background(x, y);
      add_straight(background);
    }
    BoxFit fit = fitter_.fit(pixel_);
    choose_places(background, fit);
    // Where every sample is saturated, F is at least that.
    for (size_t c = 0; c < kChannels; ++c)
      fit.foreground[c] = std::max(fit.foreground[c], saturated_light_[c]);
    if (pixel_.gray) {
      fit.foreground.fill(fit.foreground[0]);
      for (PixelBox& box : fit.boxes) {
        box.weight.fill(box.weight[0]);
        box.weight_sd.fill(box.weight_sd[0]);
      }
    }
    write(x, y, background, fit, noise_sd, matte);
  }
}

void BoxSolver::choose_places(std::span<const BackgroundPoint> background, BoxFit& fit) const {
  for (size_t m = 0; m < fit.boxes.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    if (!box.seen) continue;
    const BoxMonitor& monitor = layout_.monitors[m];
    const BackgroundPoint* const straight = background.empty() ? nullptr : &background[monitor.texture];
    for (size_t a = 0; a < 2; ++a) {
      const std::optional<double> period_px = fitter_.axis(m, a).period_px();
      if (!period_px) continue;
      Interval& side = box.side[a];
      const double first_px = std::fmod(side.centre_px(), *period_px);
      if (first_px + *period_px >= extent_px(monitor, a)) continue;
      box.misread = true;
      if (straight == nullptr || !straight->seen) continue;
      const double off_px = straight->axis[a].centre_px - first_px;
      const double last = std::floor((extent_px(monitor, a) - first_px) / *period_px);
      const double periods = std::clamp(std::round(off_px / *period_px), 0.0, last);
      const double shift_px = first_px + periods * *period_px - side.centre_px();
      side = {.low_px = side.low_px + shift_px, .high_px = side.high_px + shift_px};
    }
  }
}

void BoxSolver::write(int x, int y, std::span<const BackgroundPoint> background, const BoxFit& fit,
                      double noise_sd, Matte& matte) const {
  double strongest = 0.0;
  bool misread = false;
  struct Found {
    std::array<Mode, kChannels> modes;
    Samples3 rank;  // by which modes are ordered: a box comes before its halos
  };
  std::vector<Found> found;
  const auto variance = [](const Interval& side) {
    return static_cast<float>(side.length_px() * side.length_px() / 12.0);
  };
  for (size_t m = 0; m < fit.boxes.size(); ++m) {
    const PixelBox& box = fit.boxes[m];
    misread = misread || box.misread;
    if (!box.seen) continue;
    const auto add = [&](const std::array<Interval, 2>& side, double share) {
      Found& own = found.emplace_back();
      double on_monitor = 1.0;
      for (size_t a = 0; a < 2; ++a)
        on_monitor *= inside(side[a], extent_px(layout_.monitors[m], a)).length_px() / side[a].length_px();
      for (size_t c = 0; c < kChannels; ++c) {
        own.rank[c] = box.weight[c];
        own.modes[c] = {.weight = static_cast<float>(box.weight[c] * share / std::min(on_monitor, 1.0)),
                        .x_px = static_cast<float>(side[0].centre_px()),
                        .y_px = static_cast<float>(side[1].centre_px()),
                        .xx_px2 = variance(side[0]),
                        .xy_px2 = 0.0f,
                        .yy_px2 = variance(side[1]),
                        .texture = layout_.monitors[m].texture,
                        .weight_sd = static_cast<float>(box.weight_sd[c] * share),
                        .centre_sd_px = static_cast<float>(box.centre_sd_px)};
      }
    };
    add(box.side, box.core());
    for (size_t j = 0; j < box.halo.size(); ++j) {
      if (box.halo[j] > 0.0)
        add({fitter_.halo_side(m, j, box.side[0]), fitter_.halo_side(m, j, box.side[1])}, box.halo[j]);
    }
    strongest = std::max(strongest, *std::ranges::max_element(box.weight));
  }
  if (fit.straight > 0.0) {
    for (const BoxMonitor& monitor : layout_.monitors) {
      const BackgroundPoint& point = background[monitor.texture];
      if (!point.seen) continue;
      Found& own = found.emplace_back();
      for (size_t c = 0; c < kChannels; ++c) {
        Mode& mode = own.modes[c] = point.mode(static_cast<int>(c), monitor.texture);
        mode.weight *= static_cast<float>(fit.straight);
        own.rank[c] = mode.weight;
      }
    }
  }
  for (int c = 0; c < kChannels; ++c) {
    const size_t channel = c;
    matte.foreground(x, y)[channel] = static_cast<float>(fit.foreground[channel]);
    std::ranges::stable_sort(found, std::ranges::greater(),
                             [&](const Found& own) { return own.rank[channel]; });
    const std::span<Mode> modes = matte.modes(x, y, c);
    for (size_t i = 0; i < std::min(found.size(), modes.size()); ++i) {
      if (found[i].modes[channel].weight > 0.0f) modes[i] = found[i].modes[channel];
    }
  }
  matte.coverage(x, y) = static_cast<float>(1.0 - fit.straight);
  std::uint8_t& flags = matte.flags(x, y);
  if (fit.sample_count == 0) flags |= kFlagNoData;
  if (misread || fit.cover_unsure) flags |= kFlagPoorFit;
  if (fit.rms > std::max(kPoorNoise * noise_sd, kPoorShare * strongest)) flags |= kFlagPoorFit;
}

}  // namespace glasswing
