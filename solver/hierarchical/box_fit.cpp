#include "solver/hierarchical/box_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kFalsePositiveRate = 1e-4;  // of detecting light in noise
constexpr double kMinWeight = 0.0015;        // weights below are stray light, as in gaussian
constexpr int kMaxRounds = 6;
constexpr double kMinGain = 1e-3;  // of chi-square, in a round
constexpr double kMuch = 0.1;      // of the strongest weight
// Partial cover is tried where chi-square exceeds this multiple of the sample count, starting from these
// shares. It is accepted if it reduces n log chi-square by as much as four more parameters must.
constexpr double kPoor = 2.0;
constexpr std::array<double, 3> kStraightStarts{0.25, 0.5, 0.75};
constexpr double kCriterion = 4.0;

// Unknowns of one channel: F, then R by monitor.
constexpr int kMaxLight = 1 + kMaxModes;
using LightMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxLight, kMaxLight>;
using LightVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxLight, 1>;

// All unknowns: the boxes' ends, the light of each channel, and 1 - alpha.
constexpr int kMaxUnknowns = 4 * kMaxModes + kChannels * kMaxLight + 1;
using AllMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxUnknowns>;

std::vector<std::array<WaveAxis, 2>> axes_of(std::span<const BoxMonitor> monitors) {
  std::vector<std::array<WaveAxis, 2>> axes;
  for (const BoxMonitor& monitor : monitors) {
    axes.push_back(
        {WaveAxis(monitor.waves[0], monitor.width_px), WaveAxis(monitor.waves[1], monitor.height_px)});
  }
  return axes;
}

// Whether pattern p is followed by its complement, both with light in a channel.
bool has_complement(const BoxMonitor& monitor, const std::vector<BoxSample>& samples, size_t p, size_t c) {
  if (p + 1 >= monitor.patterns.size()) return false;
  const BoxPattern &own = monitor.patterns[p], &next = monitor.patterns[p + 1];
  return own.axis != BoxPattern::kSolid && own.axis == next.axis && own.wave == next.wave && own.sign > 0.0 &&
         own.light[c] > 0.0 && samples[p].information[c] > 0.0 && samples[p + 1].information[c] > 0.0;
}

// Whether the light has changed since the sides were searched.
bool changed(const std::vector<PixelBox>& before, const std::vector<PixelBox>& after) {
  double change = 0.0, light = 0.0;
  for (size_t m = 0; m < after.size(); ++m) {
    for (size_t c = 0; c < kChannels; ++c) {
      change = std::max(change, std::abs(after[m].weight[c] - before[m].weight[c]));
      light = std::max(light, after[m].weight[c]);
    }
  }
  return change > kMuch * light;
}

}  // namespace

BoxFitter::BoxFitter(std::span<const BoxMonitor> monitors) : monitors_(monitors), axes_(axes_of(monitors)) {
  for (const BoxMonitor& monitor : monitors) {
    const size_t most = kChannels * (monitor.patterns.size() + 1);
    seen_thresholds_.push_back(chi_square_quantile(static_cast<double>(most), kFalsePositiveRate));
    lit_.emplace_back(monitor.patterns.size(), 1.0);
    information_.emplace_back(monitor.patterns.size());
  }
}

// Starting values: F from black or the darkest sample, R from the brightest solid or the largest difference
// between a wave and its complement.
void BoxFitter::begin(const BoxPixel& pixel, BoxFit& fit) const {
  for (size_t c = 0; c < kChannels; ++c) {
    double darkest = INFINITY;
    for (const std::vector<BoxSample>& samples : pixel.samples) {
      for (const BoxSample& sample : samples) {
        if (sample.information[c] > 0.0) darkest = std::min(darkest, sample.radiance[c]);
      }
    }
    const bool black = pixel.black.information[c] > 0.0;
    fit.foreground[c] = black ? pixel.black.radiance[c] : std::isfinite(darkest) ? darkest : 0.0;
  }
  fit.boxes.assign(monitors_.size(), {});
  for (size_t m = 0; m < monitors_.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    const std::vector<BoxSample>& samples = pixel.samples[m];
    for (size_t c = 0; c < kChannels; ++c) {
      double solid = 0.0, contrast = 0.0;
      for (size_t p = 0; p < samples.size(); ++p) {
        const BoxPattern& pattern = monitors_[m].patterns[p];
        const double light = pattern.light[c];
        if (light <= 0.0 || samples[p].information[c] <= 0.0) continue;
        if (pattern.axis == BoxPattern::kSolid && light > solid) {
          solid = light;
          box.weight[c] = (samples[p].radiance[c] - fit.foreground[c]) / light;
        } else if (solid == 0.0 && has_complement(monitors_[m], samples, p, c)) {
          contrast =
              std::max(contrast, std::abs(samples[p].radiance[c] - samples[p + 1].radiance[c]) / light);
          box.weight[c] = contrast;
        }
      }
      box.weight[c] = std::max(box.weight[c], 0.0);
    }
    box.seen = sees(pixel, m, box.weight);
    if (!box.seen) box.weight = {};
  }
}

// Whether waves and solids change the pixel by more than noise.
bool BoxFitter::sees(const BoxPixel& pixel, size_t m, const Samples3& weight) const {
  const std::vector<BoxSample>& samples = pixel.samples[m];
  if (*std::ranges::max_element(weight) < kMinWeight) return false;
  double chi_square = 0.0;
  for (size_t c = 0; c < kChannels; ++c) {
    const auto add = [&](const BoxSample& a, const BoxSample& b) {
      const double difference = a.radiance[c] - b.radiance[c];
      if (a.information[c] > 0.0 && b.information[c] > 0.0)
        chi_square += difference * difference / (1.0 / a.information[c] + 1.0 / b.information[c]);
    };
    for (size_t p = 0; p < samples.size(); ++p) {
      if (has_complement(monitors_[m], samples, p, c)) add(samples[p], samples[p + 1]);
      if (monitors_[m].patterns[p].axis == BoxPattern::kSolid) add(samples[p], pixel.black);
    }
  }
  return chi_square > seen_thresholds_[m];
}

void BoxFitter::place(const BoxPixel& pixel, bool anew, BoxFit& fit) {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    if (!box.seen) continue;
    const std::vector<BoxSample>& samples = pixel.samples[m];
    for (size_t a = 0; a < 2; ++a) {
      const WaveAxis& axis = axes_[m][a];
      // v of each wave by least squares over channels, wave and complement.
      std::array<double, WaveAxis::kMaxWaves> top{}, bottom{};
      for (size_t p = 0; p < samples.size(); ++p) {
        const BoxPattern& pattern = monitors_[m].patterns[p];
        if (pattern.axis != static_cast<int>(a)) continue;
        for (size_t c = 0; c < kChannels; ++c) {
          const double half = 0.5 * box.weight[c] * pattern.light[c];
          const double rest =
              samples[p].radiance[c] - fit.foreground[c] - fit.straight * samples[p].straight[c] - half;
          top[pattern.wave] += information_[m][p][c] * half * pattern.sign * rest;
          bottom[pattern.wave] += information_[m][p][c] * half * half;
        }
      }
      seen_.resize(axis.wave_count());
      for (size_t k = 0; k < axis.wave_count(); ++k) {
        const double u = bottom[k] > 0.0 ? top[k] / bottom[k] : 0.0;
        seen_[k] = {.u = static_cast<float>(u), .weight = static_cast<float>(bottom[k])};
      }
      box.side[a] = (anew ? axis.search(seen_) : axis.refine(seen_, box.side[a])).interval;
    }
  }
}

void BoxFitter::see(const BoxFit& fit) {
  std::array<double, WaveAxis::kMaxWaves> v;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (!fit.boxes[m].seen) continue;
    for (size_t a = 0; a < 2; ++a) {
      axes_[m][a].means(fit.boxes[m].side[a], v);
      for (size_t p = 0; p < lit_[m].size(); ++p) {
        const BoxPattern& pattern = monitors_[m].patterns[p];
        if (pattern.axis == static_cast<int>(a)) lit_[m][p] = 0.5 * (1.0 + pattern.sign * v[pattern.wave]);
      }
    }
  }
}

// Fits F and R of each channel and 1 - alpha by least squares, clamped to at least 0.
void BoxFitter::weigh(const BoxPixel& pixel, bool straight_is_free, BoxFit& fit) const {
  const auto unknowns = static_cast<Eigen::Index>(1 + monitors_.size());
  std::array<LightMatrix, kChannels> normal;
  std::array<LightVector, kChannels> right, by_straight;
  double top = 0.0, bottom = 0.0;  // of 1 - alpha
  std::array<std::array<bool, kMaxLight>, kChannels> none{};
  const auto solve = [&](size_t c, const LightVector& side) {
    LightMatrix matrix = normal[c];
    LightVector vector = side;
    const double ridge = 1e-12 * matrix.trace() + 1e-30;
    for (Eigen::Index i = 0; i < unknowns; ++i) {
      matrix(i, i) += ridge;
      if (!none[c][static_cast<size_t>(i)]) continue;
      matrix.row(i).setZero();
      matrix.col(i).setZero();
      matrix(i, i) = 1.0;
      vector(i) = 0.0;
    }
    return LightVector(matrix.ldlt().solve(vector));
  };
  for (size_t c = 0; c < kChannels; ++c) {
    normal[c].setZero(unknowns, unknowns);
    right[c].setZero(unknowns);
    by_straight[c].setZero(unknowns);
    const double dark = pixel.black.information[c];
    normal[c](0, 0) += dark;
    right[c](0) += dark * pixel.black.radiance[c];
    for (size_t m = 0; m < monitors_.size(); ++m) {
      const auto at = static_cast<Eigen::Index>(1 + m);
      none[c][1 + m] = !fit.boxes[m].seen;
      for (size_t p = 0; p < lit_[m].size(); ++p) {
        const BoxSample& sample = pixel.samples[m][p];
        const double information = information_[m][p][c];
        const double lit = fit.boxes[m].seen ? lit_[m][p] * monitors_[m].patterns[p].light[c] : 0.0;
        normal[c](0, 0) += information;
        normal[c](0, at) += information * lit;
        normal[c](at, at) += information * lit * lit;
        right[c](0) += information * sample.radiance[c];
        right[c](at) += information * lit * sample.radiance[c];
        by_straight[c](0) += information * sample.straight[c];
        by_straight[c](at) += information * lit * sample.straight[c];
        bottom += information * sample.straight[c] * sample.straight[c];
        top += information * sample.straight[c] * sample.radiance[c];
      }
      normal[c](at, 0) = normal[c](0, at);
    }
  }
  for (bool again = true; again;) {
    again = false;
    if (straight_is_free) {
      double own_top = top, own_bottom = bottom;
      for (size_t c = 0; c < kChannels; ++c) {
        const LightVector taken = solve(c, by_straight[c]);
        own_top -= taken.dot(right[c]);
        own_bottom -= taken.dot(by_straight[c]);
      }
      fit.straight = own_bottom > 1e-9 * bottom ? std::clamp(own_top / own_bottom, 0.0, 1.0) : 0.0;
    }
    for (size_t c = 0; c < kChannels; ++c) {
      const LightVector light = solve(c, right[c] - fit.straight * by_straight[c]);
      fit.foreground[c] = light(0);
      for (size_t m = 0; m < monitors_.size(); ++m) {
        fit.boxes[m].weight[c] = light(static_cast<Eigen::Index>(1 + m));
        if (fit.boxes[m].weight[c] >= 0.0) continue;
        none[c][1 + m] = again = true;
      }
    }
  }
}

void BoxFitter::judge(const BoxPixel& pixel, BoxFit& fit) const {
  double squares = 0.0;
  fit.chi_square = 0.0;
  fit.sample_count = 0;
  const auto add = [&](double miss, double information) {
    if (information <= 0.0) return;
    fit.chi_square += information * miss * miss;
    squares += miss * miss;
    ++fit.sample_count;
  };
  for (size_t c = 0; c < kChannels; ++c) {
    add(pixel.black.radiance[c] - fit.foreground[c], pixel.black.information[c]);
    for (size_t m = 0; m < monitors_.size(); ++m) {
      for (size_t p = 0; p < lit_[m].size(); ++p) {
        const BoxSample& sample = pixel.samples[m][p];
        add(sample.radiance[c] - model(fit, sample, m, p, c), information_[m][p][c]);
      }
    }
  }
  fit.rms = std::sqrt(squares / std::max(fit.sample_count, 1));
}

// The mean square residual of waves beyond their noise: the footprint is not exactly a box. Solids do not
// depend on its shape.
double BoxFitter::misfit_of(const BoxPixel& pixel, const BoxFit& fit) const {
  double sum = 0.0, count = 0.0;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    for (size_t p = 0; p < lit_[m].size(); ++p) {
      if (monitors_[m].patterns[p].axis == BoxPattern::kSolid) continue;
      const BoxSample& sample = pixel.samples[m][p];
      for (size_t c = 0; c < kChannels; ++c) {
        if (sample.information[c] <= 0.0) continue;
        const double miss = sample.radiance[c] - model(fit, sample, m, p, c);
        sum += miss * miss - 1.0 / sample.information[c];
        count += 1.0;
      }
    }
  }
  return count > 0.0 ? std::max(sum / count, 0.0) : 0.0;
}

void BoxFitter::doubt(const BoxPixel& pixel, double misfit) {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    for (size_t p = 0; p < lit_[m].size(); ++p) {
      const double own = monitors_[m].patterns[p].axis == BoxPattern::kSolid ? 0.0 : misfit;
      for (size_t c = 0; c < kChannels; ++c) {
        const double information = pixel.samples[m][p].information[c];
        information_[m][p][c] = information / (1.0 + own * information);
      }
    }
  }
}

double BoxFitter::model(const BoxFit& fit, const BoxSample& sample, size_t m, size_t p, size_t c) const {
  return fit.foreground[c] + fit.straight * sample.straight[c] +
         fit.boxes[m].weight[c] * monitors_[m].patterns[p].light[c] * lit_[m][p];
}

void BoxFitter::settle(const BoxPixel& pixel, bool anew, bool straight_is_free, BoxFit& fit) {
  fit.chi_square = INFINITY;
  BoxFit next = fit;
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::vector<PixelBox> before = next.boxes;
    place(pixel, anew, next);
    see(next);
    weigh(pixel, straight_is_free, next);
    judge(pixel, next);
    // The first guess of the light may be far off without solids, or where 1 - alpha changes.
    anew = anew && round == 0 && changed(before, next.boxes);
    if (!(next.chi_square < fit.chi_square)) break;
    const bool enough = next.chi_square > (1.0 - kMinGain) * fit.chi_square;
    fit = next;
    if (enough) break;
  }
}

BoxFit BoxFitter::fit(const BoxPixel& pixel) {
  BoxFit start;
  begin(pixel, start);
  BoxFit best = start;
  doubt(pixel, 0.0);
  if (std::ranges::none_of(start.boxes, &PixelBox::seen)) {
    see(best);
    weigh(pixel, false, best);
    judge(pixel, best);
    return best;
  }
  settle(pixel, true, false, best);
  const auto count = static_cast<double>(best.sample_count);
  const bool poor = best.chi_square > kPoor * count;
  see(best);
  doubt(pixel, misfit_of(pixel, best));
  settle(pixel, false, false, best);
  if (pixel.has_straight && poor) {
    double enough = best.chi_square * std::exp(-kCriterion * std::log(count) / count);
    for (const double straight : kStraightStarts) {
      BoxFit partly = start;
      partly.straight = straight;
      for (size_t m = 0; m < monitors_.size(); ++m) {
        for (size_t p = 0; p < pixel.samples[m].size(); ++p) {
          if (monitors_[m].patterns[p].axis != BoxPattern::kSolid) continue;
          for (size_t c = 0; c < kChannels; ++c) {
            const double light = monitors_[m].patterns[p].light[c];
            if (light > 0.0)
              partly.boxes[m].weight[c] = std::max(
                  start.boxes[m].weight[c] - straight * pixel.samples[m][p].straight[c] / light, 0.0);
          }
        }
      }
      settle(pixel, true, true, partly);
      if (partly.chi_square >= enough || partly.straight <= 0.0) continue;
      enough = partly.chi_square;
      best = partly;
    }
  }
  if (best.straight > 0.0) {
    see(best);
    doubt(pixel, misfit_of(pixel, best));
    settle(pixel, false, true, best);
  }
  see(best);
  estimate_errors(pixel, best);
  return best;
}

// Standard errors from the inverse of the normal matrix.
void BoxFitter::estimate_errors(const BoxPixel& pixel, BoxFit& fit) const {
  const auto monitors = static_cast<Eigen::Index>(monitors_.size());
  const Eigen::Index light_count = 1 + monitors, first_light = 4 * monitors;
  const Eigen::Index straight = first_light + kChannels * light_count;
  AllMatrix normal = AllMatrix::Zero(straight + 1, straight + 1);
  const auto add = [&](double information, std::span<const std::pair<Eigen::Index, double>> slopes) {
    for (const auto& [i, by_i] : slopes) {
      for (const auto& [j, by_j] : slopes) normal(i, j) += information * by_i * by_j;
    }
  };
  for (Eigen::Index c = 0; c < kChannels; ++c) {
    const Eigen::Index foreground = first_light + c * light_count;
    add(pixel.black.information[static_cast<size_t>(c)], std::array{std::pair(foreground, 1.0)});
  }
  for (Eigen::Index m = 0; m < monitors; ++m) {
    const auto own = static_cast<size_t>(m);
    const PixelBox& box = fit.boxes[own];
    for (size_t p = 0; p < lit_[own].size(); ++p) {
      const BoxPattern& pattern = monitors_[own].patterns[p];
      const BoxSample& sample = pixel.samples[own][p];
      double by_low = 0.0, by_high = 0.0;  // of h
      Eigen::Index low = 4 * m;
      if (pattern.axis != BoxPattern::kSolid && box.seen) {
        const auto a = static_cast<size_t>(pattern.axis);
        const WaveAxis& axis = axes_[own][a];
        const Interval& side = box.side[a];
        const double v = pattern.sign * (2.0 * lit_[own][p] - 1.0);
        const double scale = 0.5 * pattern.sign / side.length_px();
        by_low = scale * (v - axis.wave_at(pattern.wave, side.low_px));
        by_high = scale * (axis.wave_at(pattern.wave, side.high_px) - v);
        low += 2 * pattern.axis;
      }
      for (Eigen::Index c = 0; c < kChannels; ++c) {
        const auto channel = static_cast<size_t>(c);
        const double light = pattern.light[channel], weight = light * box.weight[channel];
        const Eigen::Index foreground = first_light + c * light_count;
        add(information_[own][p][channel],
            std::array{std::pair(low, weight * by_low), std::pair(low + 1, weight * by_high),
                       std::pair(foreground, 1.0), std::pair(foreground + 1 + m, light * lit_[own][p]),
                       std::pair(straight, fit.straight > 0.0 ? sample.straight[channel] : 0.0)});
      }
    }
    // Without the edge of a bar nearby, an end is uncertain within the finest bar.
    for (Eigen::Index end = 0; end < 4; ++end) {
      const double bar_px = axes_[own][static_cast<size_t>(end / 2)].finest_bar_px();
      normal(4 * m + end, 4 * m + end) += 12.0 / (bar_px * bar_px);
    }
  }
  // Undetermined unknowns keep no standard error.
  for (Eigen::Index i = first_light; i <= straight; ++i) {
    if (normal(i, i) <= 0.0) normal(i, i) = 1.0;
  }
  const AllMatrix covariance = normal.ldlt().solve(AllMatrix::Identity(straight + 1, straight + 1));
  for (Eigen::Index m = 0; m < monitors; ++m) {
    PixelBox& box = fit.boxes[static_cast<size_t>(m)];
    if (!box.seen) continue;
    for (Eigen::Index c = 0; c < kChannels; ++c) {
      const Eigen::Index weight = first_light + c * light_count + 1 + m;
      box.weight_sd[static_cast<size_t>(c)] = std::sqrt(std::max(covariance(weight, weight), 0.0));
    }
    double variance = 0.0;  // of both coordinates of the centre
    for (const Eigen::Index low : {4 * m, 4 * m + 2})
      variance +=
          0.25 * (covariance(low, low) + covariance(low + 1, low + 1) + 2.0 * covariance(low, low + 1));
    box.centre_sd_px = std::sqrt(std::max(0.5 * variance, 0.0));
  }
}

}  // namespace glasswing
