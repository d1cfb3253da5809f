#include "solver/hierarchical/box_fit.h"

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
constexpr std::array<double, 4> kStraightStarts{0.5, 0.25, 0.75, 0.0};
constexpr double kHopeless = 5.0;  // a start that ends beyond this multiple of what is accepted is the last
constexpr std::array<double, 7> kStraightSteps{0.05, 0.1, -0.05, 0.15, 0.2, 0.25, -0.1};
constexpr size_t kFirstSteps = 2;  // that must halve chi-square
constexpr double kCriterion = 4.0;
// Without it, at least this much is left of the background's contrast, though a box stands in for most of it:
// a fifth and more of the background, beside a box of any place and size, left 0.036.
constexpr double kLeastLeft = 0.012;
constexpr double kAlike = 0.07;      // of the strongest weight: waves that differ by less look alike
constexpr double kCoverError = 0.1;  // of alpha, beyond which it is not certain

constexpr double kHaloStep = 4.0;   // from the finest bar to the narrowest halo, and on to the next
constexpr double kMinCore = 0.1;    // of the light: what the box keeps beside halos
constexpr double kBeyond = 3.0;     // standard deviations of chi-square that noise explains
constexpr double kSurely = 9.0;     // chi-square by which a misreading is excluded
constexpr double kSoftPrice = 1.4;  // of a soft box and of each halo, in log n
constexpr double kClearly = 2.0;    // in n log chi-square: less says nothing (Kass and Raftery 1995)
constexpr double kSeparable = 0.7;  // by which lit shares must differ to tell F from R
constexpr double kUnlit = 0.1;      // where they differ by less, all light is F
constexpr double kMaxSoft = 4.0;    // finest bars: wider footprints are boxes only
constexpr double kNarrow = 2.0;     // finest bars: wider ones may be boxes elsewhere
constexpr double kLeash = 0.375;    // finest bars by which a soft box may leave the decoded position
constexpr double kApart = 0.75;     // finest bars between readings that are not the same

constexpr double kSidePerSigma = 3.09;  // of the box whose response to an edge is nearest to a Gaussian's

WaveAxis::SoftSide soft_side(const Interval& side) {
  return {.t_px = side.centre_px(), .sigma_px = side.length_px() / kSidePerSigma};
}

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

// Chi-square around their mean of what all waves show, `light`.
double spread_of(const BoxMonitor& monitor, const std::vector<BoxSample>& samples, size_t c,
                 Samples3 BoxSample::*light) {
  double sum = 0.0, squares = 0.0, information = 0.0;
  for (size_t p = 0; p < samples.size(); ++p) {
    if (monitor.patterns[p].axis == BoxPattern::kSolid) continue;
    const double own = samples[p].information[c], y = (samples[p].*light)[c];
    sum += own * y;
    squares += own * y * y;
    information += own;
  }
  return information > 0.0 ? squares - sum * sum / information : 0.0;
}

// The brightest less the darkest wave.
double range_of(const BoxMonitor& monitor, const std::vector<BoxSample>& samples, size_t c) {
  double least = INFINITY, most = -INFINITY;
  for (size_t p = 0; p < samples.size(); ++p) {
    if (monitor.patterns[p].axis == BoxPattern::kSolid || samples[p].information[c] <= 0.0) continue;
    least = std::min(least, samples[p].radiance[c]);
    most = std::max(most, samples[p].radiance[c]);
  }
  return std::max(most - least, 0.0);
}

double misfit(std::span<const WaveAxis::Seen> seen, std::span<const double> v) {
  double sum = 0.0;
  for (size_t k = 0; k < seen.size(); ++k) sum += seen[k].weight * std::pow(seen[k].u - v[k], 2);
  return sum;
}

// Whether noise explains the residual.
bool explains(const BoxFit& fit) {
  const double count = fit.sample_count;
  return fit.chi_square <= count + kBeyond * std::sqrt(2.0 * count);
}

double halo_count(const BoxFit& fit) {
  double count = 0.0;
  for (const PixelBox& box : fit.boxes)
    count += static_cast<double>(std::ranges::count_if(box.halo, [](double g) { return g > 0.0; }));
  return count;
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

Interval inside(const Interval& side, double extent_px) {
  constexpr double kMin = WaveAxis::kMinLength_px;
  const double low_px = std::clamp(side.low_px, 0.0, extent_px - kMin);
  return {.low_px = low_px, .high_px = std::clamp(side.high_px, low_px + kMin, extent_px)};
}

double extent_px(const BoxMonitor& monitor, size_t axis) {
  return axis == 0 ? monitor.width_px : monitor.height_px;
}

double PixelBox::core() const {
  double core = 1.0;
  for (const double share : halo) core -= share;
  return core;
}

BoxFitter::BoxFitter(std::span<const BoxMonitor> monitors, size_t halos)
    : monitors_(monitors), axes_(axes_of(monitors)), sums_(monitors) {
  for (size_t m = 0; m < monitors.size(); ++m) {
    const BoxMonitor& monitor = monitors[m];
    const std::array<double, 2>& bars_px =
        finest_bars_px_.emplace_back(std::array{axes_[m][0].finest_bar_px(), axes_[m][1].finest_bar_px()});
    std::vector<double>& widths_px = halo_widths_px_.emplace_back();
    const double widest_px = std::min(monitor.width_px, monitor.height_px);
    for (double width_px = kHaloStep * std::max(bars_px[0], bars_px[1]);
         width_px < widest_px && widths_px.size() < halos; width_px *= kHaloStep)
      widths_px.push_back(width_px);
    const auto threshold = [&](size_t channels) {
      return chi_square_quantile(static_cast<double>(channels * (monitor.patterns.size() + 1)),
                                 kFalsePositiveRate);
    };
    seen_thresholds_.push_back({threshold(kChannels), threshold(1)});
    v_.push_back(sums_.blank_means(m));
    slopes_.emplace_back(v_.back().size());
    parts_.emplace_back();
  }
}

// Starting values: F from black or the darkest sample; R from the brightest solid, the largest difference
// between a wave and its complement, or the range of all waves.
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
      if (solid == 0.0 && contrast == 0.0) box.weight[c] = range_of(monitors_[m], samples, c);
      box.weight[c] = std::max(box.weight[c], 0.0);
    }
    box.seen = sees(pixel, m, box.weight);
    if (!box.seen) box.weight = {};
  }
}

// Whether waves and their complements, and solids and black, differ by more than noise; without either,
// whether waves differ from each other.
bool BoxFitter::sees(const BoxPixel& pixel, size_t m, const Samples3& weight) const {
  const std::vector<BoxSample>& samples = pixel.samples[m];
  if (*std::ranges::max_element(weight) < kMinWeight) return false;
  double chi_square = 0.0;
  for (size_t c = 0; c < kChannels; ++c) {
    bool compared = false;
    const auto add = [&](const BoxSample& a, const BoxSample& b) {
      if (a.information[c] <= 0.0 || b.information[c] <= 0.0) return;
      const double difference = a.radiance[c] - b.radiance[c];
      chi_square += difference * difference / (1.0 / a.information[c] + 1.0 / b.information[c]);
      compared = true;
    };
    for (size_t p = 0; p < samples.size(); ++p) {
      if (has_complement(monitors_[m], samples, p, c)) add(samples[p], samples[p + 1]);
      if (monitors_[m].patterns[p].axis == BoxPattern::kSolid) add(samples[p], pixel.black);
    }
    if (!compared) chi_square += spread_of(monitors_[m], samples, c, &BoxSample::radiance);
  }
  return chi_square > seen_thresholds_[m][pixel.gray ? 1 : 0];
}

void BoxFitter::observe(const BoxFit& fit, size_t m) {
  for (size_t a = 0; a < 2; ++a) sums_.observe(fit, m, a, seen_[a]);
}

Interval BoxFitter::halo_side(size_t m, size_t halo, const Interval& box) const {
  const double half_px = 0.5 * std::max(halo_widths_px_[m][halo], box.length_px());
  return {.low_px = box.centre_px() - half_px, .high_px = box.centre_px() + half_px};
}

void BoxFitter::means(size_t m, size_t a, const PixelBox& box, Parts& parts, std::span<double> v) const {
  const WaveAxis& axis = axes_[m][a];
  if (!box.soft) {
    axis.means(box.side[a], v);
    return;
  }
  const WaveAxis::SoftMeans soft = axis.soft_means(soft_side(box.side[a]));
  for (size_t k = 0; k < axis.wave_count(); ++k) parts[0][k] = static_cast<double>(soft.v[k]);
  for (size_t j = 0; j < halo_widths_px_[m].size(); ++j)
    axis.means(inside(halo_side(m, j, box.side[a]), extent_px(monitors_[m], a)), parts[1 + j]);
  for (size_t k = 0; k < axis.wave_count(); ++k) {
    v[k] = box.core() * parts[0][k];
    for (size_t j = 0; j < halo_widths_px_[m].size(); ++j) v[k] += box.halo[j] * parts[1 + j][k];
  }
}

namespace {

using Amounts = std::array<double, kMaxParts>;

// Solves normal * x = right over the amounts of `free` by elimination; the others are 0.
Amounts solve_free(const std::array<Amounts, kMaxParts>& normal, const Amounts& right, size_t parts,
                   const std::array<bool, kMaxParts>& free) {
  constexpr double kRidge = 1e-9;  // of the diagonal: wide halos may be alike
  std::array<size_t, kMaxParts> own{};
  size_t count = 0;
  for (size_t i = 0; i < parts; ++i) {
    if (free[i]) own[count++] = i;
  }
  std::array<Amounts, kMaxParts> left{};
  Amounts rest{}, x{};
  for (size_t i = 0; i < count; ++i) {
    for (size_t j = 0; j < count; ++j) left[i][j] = normal[own[i]][own[j]];
    left[i][i] *= 1.0 + kRidge;
    rest[i] = right[own[i]];
  }
  for (size_t i = 0; i < count; ++i) {
    if (!(left[i][i] > 0.0)) continue;
    for (size_t j = i + 1; j < count; ++j) {
      const double share = left[j][i] / left[i][i];
      for (size_t k = i + 1; k < count; ++k) left[j][k] -= share * left[i][k];
      rest[j] -= share * rest[i];
    }
  }
  for (size_t i = count; i-- > 0;) {
    double sum = rest[i];
    for (size_t j = i + 1; j < count; ++j) sum -= left[i][j] * x[own[j]];
    x[own[i]] = left[i][i] > 0.0 ? sum / left[i][i] : 0.0;
  }
  return x;
}

// Non-negative least squares by active sets (Lawson and Hanson 1974, chapter 23), from the amounts given,
// which are at least 0.
void solve_amounts(const std::array<Amounts, kMaxParts>& normal, const Amounts& right, size_t parts,
                   Amounts& amount) {
  constexpr double kEnough = 1e-9;  // of the largest right side
  constexpr size_t kMaxSolves = 4 * kMaxParts;
  double scale = 0.0;
  std::array<bool, kMaxParts> free{};
  for (size_t i = 0; i < parts; ++i) {
    free[i] = amount[i] > 0.0;
    scale = std::max(scale, std::abs(right[i]));
  }
  for (size_t solves = 0; solves < kMaxSolves; ++solves) {
    const Amounts next = solve_free(normal, right, parts, free);
    // As far towards the solution as no amount is negative.
    double reach = 1.0;
    size_t first = parts;
    for (size_t i = 0; i < parts; ++i) {
      if (!free[i] || next[i] >= 0.0 || amount[i] > reach * (amount[i] - next[i])) continue;
      reach = amount[i] / (amount[i] - next[i]);
      first = i;
    }
    for (size_t i = 0; i < parts; ++i) amount[i] = std::max(amount[i] + reach * (next[i] - amount[i]), 0.0);
    if (first < parts) {
      free[first] = false;
      amount[first] = 0.0;
      continue;
    }
    double steepest = kEnough * scale;
    for (size_t i = 0; i < parts; ++i) {
      if (free[i]) continue;
      double slope = right[i];
      for (size_t j = 0; j < parts; ++j) slope -= normal[i][j] * amount[j];
      if (slope <= steepest) continue;
      steepest = slope;
      first = i;
    }
    if (first == parts) return;
    free[first] = true;
  }
}

}  // namespace

void BoxFitter::spread(size_t m, PixelBox& box) {
  const size_t parts = 1 + halo_widths_px_[m].size();
  const std::array<Parts, 2>& v = parts_[m];
  std::array<Amounts, kMaxParts> normal{};
  Amounts right{}, amount{};
  for (size_t a = 0; a < 2; ++a) {
    for (size_t k = 0; k < seen_[a].size(); ++k) {
      const auto u = static_cast<double>(seen_[a][k].u), weight = static_cast<double>(seen_[a][k].weight);
      for (size_t i = 0; i < parts; ++i) {
        const double own = weight * v[a][i][k];
        right[i] += own * u;
        for (size_t j = 0; j <= i; ++j) normal[i][j] += own * v[a][j][k];
      }
    }
  }
  for (size_t i = 0; i < parts; ++i) {
    for (size_t j = i + 1; j < parts; ++j) normal[i][j] = normal[j][i];
  }
  amount[0] = 1.0;
  for (size_t j = 1; j < parts; ++j) amount[j] = box.halo[j - 1];
  solve_amounts(normal, right, parts, amount);
  double sum = 0.0;
  for (size_t i = 0; i < parts; ++i) sum += amount[i];
  // Without light of its own a box has no place.
  if (!(amount[0] > kMinCore * sum)) return;
  for (size_t j = 1; j < parts; ++j) box.halo[j - 1] = amount[j] / sum;
  for (size_t a = 0; a < 2; ++a) {
    for (size_t k = 0; k < seen_[a].size(); ++k) {
      double u = seen_[a][k].u;
      for (size_t j = 1; j < parts; ++j) u -= amount[j] * v[a][j][k];
      seen_[a][k].u = static_cast<float>(u / amount[0]);
      seen_[a][k].weight *= static_cast<float>(amount[0] * amount[0]);
    }
  }
}

void BoxFitter::place(bool anew, BoxFit& fit) {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    if (!box.seen) continue;
    observe(fit, m);
    if (box.soft) spread(m, box);
    for (size_t a = 0; a < 2; ++a) {
      const WaveAxis& axis = axes_[m][a];
      if (box.soft) {
        const WaveAxis::SoftSide side = axis.refine_soft(seen_[a], soft_side(box.side[a]));
        const double half_px = 0.5 * kSidePerSigma * side.sigma_px, reach_px = kLeash * axis.finest_bar_px();
        const double centre_px =
            std::clamp(side.t_px, box.decoded_px[a] - reach_px, box.decoded_px[a] + reach_px);
        box.side[a] = {.low_px = centre_px - half_px, .high_px = centre_px + half_px};
        continue;
      }
      box.side[a] = (anew ? axis.search(seen_[a], box.side[a]) : axis.refine(seen_[a], box.side[a])).interval;
    }
  }
}

void BoxFitter::see(const BoxFit& fit) {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (!fit.boxes[m].seen) continue;
    for (size_t a = 0; a < 2; ++a)
      means(m, a, fit.boxes[m], parts_[m][a], std::span(v_[m]).subspan(sums_.first_wave(m, a)));
  }
}

// The mean square residual of waves beyond their noise: the footprint is not exactly a box. Solids do not
// depend on its shape.
double BoxFitter::misfit_of(const BoxPixel& pixel, const BoxFit& fit) const {
  double sum = 0.0, count = 0.0;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    for (size_t p = 0; p < pixel.samples[m].size(); ++p) {
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

// The same for standard errors: of a wave and its complement only the difference shows the footprint's shape,
// and fitted parameters take residuals away.
double BoxFitter::shape_error_of(const BoxPixel& pixel, const BoxFit& fit) const {
  double squares = 0.0, noise = 0.0, count = 0.0, parameters = halo_count(fit);
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (!fit.boxes[m].seen) continue;
    parameters += 4.0;
    const std::vector<BoxSample>& samples = pixel.samples[m];
    for (size_t p = 0; p < samples.size(); ++p) {
      if (monitors_[m].patterns[p].axis == BoxPattern::kSolid) continue;
      for (size_t c = 0; c < kChannels; ++c) {
        if (samples[p].information[c] <= 0.0 || (p > 0 && has_complement(monitors_[m], samples, p - 1, c)))
          continue;
        const bool pair = has_complement(monitors_[m], samples, p, c);
        double miss = samples[p].radiance[c] - model(fit, samples[p], m, p, c);
        double variance = 1.0 / samples[p].information[c];
        if (pair) {
          miss -= samples[p + 1].radiance[c] - model(fit, samples[p + 1], m, p + 1, c);
          variance += 1.0 / samples[p + 1].information[c];
        }
        squares += miss * miss / (pair ? 2.0 : 1.0);
        noise += variance / (pair ? 2.0 : 1.0);
        count += 1.0;
      }
    }
  }
  const double degrees = std::max(count - parameters, 1.0);
  return count > 0.0 ? std::max((squares - noise * degrees / count) / degrees, 0.0) : 0.0;
}

double BoxFitter::lit(size_t m, size_t p) const {
  return 0.5 * (1.0 + monitors_[m].patterns[p].sign * v_[m][sums_.entry(m, p)]);
}

double BoxFitter::model(const BoxFit& fit, const BoxSample& sample, size_t m, size_t p, size_t c) const {
  return fit.foreground[c] + fit.straight * sample.straight[c] +
         fit.boxes[m].weight[c] * monitors_[m].patterns[p].light[c] * lit(m, p);
}

double BoxFitter::rms_of(const BoxPixel& pixel, const BoxFit& fit) const {
  double squares = 0.0;
  for (size_t c = 0; c < pixel.channel_count(); ++c) {
    if (pixel.black.information[c] > 0.0) squares += std::pow(pixel.black.radiance[c] - fit.foreground[c], 2);
    for (size_t m = 0; m < monitors_.size(); ++m) {
      for (size_t p = 0; p < pixel.samples[m].size(); ++p) {
        const BoxSample& sample = pixel.samples[m][p];
        if (sample.information[c] > 0.0)
          squares += std::pow(sample.radiance[c] - model(fit, sample, m, p, c), 2);
      }
    }
  }
  return std::sqrt(squares / std::max(fit.sample_count, 1));
}

void BoxFitter::settle(bool anew, bool straight_is_free, BoxFit& fit) {
  fit.chi_square = INFINITY;
  BoxFit next = fit;
  if (std::ranges::any_of(next.boxes, &PixelBox::soft)) see(next);  // spread() needs their parts
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::vector<PixelBox> before = next.boxes;
    place(anew, next);
    see(next);
    sums_.fit_light(v_, straight_is_free, next);
    // The first guess of the light may be far off without solids, or where 1 - alpha changes.
    anew = anew && round == 0 && changed(before, next.boxes);
    if (!(next.chi_square < fit.chi_square)) break;
    const bool enough = next.chi_square > (1.0 - kMinGain) * fit.chi_square;
    fit = next;
    if (enough) break;
  }
}

bool BoxFitter::narrower(const BoxFit& fit, double bars) const {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    for (size_t a = 0; a < 2; ++a) {
      if (fit.boxes[m].seen && fit.boxes[m].side[a].length_px() > bars * axes_[m][a].finest_bar_px())
        return false;
    }
  }
  return true;
}

bool BoxFitter::near(const BoxFit& fit, const BoxFit& soft) const {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    for (size_t a = 0; a < 2; ++a) {
      const double off_px = fit.boxes[m].side[a].centre_px() - soft.boxes[m].decoded_px[a];
      if (soft.boxes[m].seen && std::abs(off_px) > axes_[m][a].finest_bar_px()) return false;
    }
  }
  return true;
}

std::optional<BoxFit> BoxFitter::decoded(const BoxFit& start) {
  BoxFit fit = start;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    if (!box.seen) continue;
    box.soft = true;
    observe(fit, m);
    for (size_t a = 0; a < 2; ++a) {
      const std::optional<double> place_px = axes_[m][a].decode(seen_[a]);
      if (!place_px) return std::nullopt;
      box.decoded_px[a] = *place_px;
      const double half_px = 0.5 * axes_[m][a].finest_bar_px();
      box.side[a] = {.low_px = *place_px - half_px, .high_px = *place_px + half_px};
    }
  }
  settle(false, false, fit);
  return fit;
}

double BoxFitter::lit_range(const BoxPixel& pixel, size_t m) const {
  double range = 1.0;
  for (size_t c = 0; c < pixel.channel_count(); ++c) {
    double darkest = pixel.black.information[c] > 0.0 ? 0.0 : 1.0, brightest = 0.0;
    bool seen = false;
    for (size_t p = 0; p < pixel.samples[m].size(); ++p) {
      if (pixel.samples[m][p].information[c] <= 0.0) continue;
      seen = true;
      darkest = std::min(darkest, lit(m, p));
      brightest = std::max(brightest, lit(m, p));
    }
    if (seen) range = std::min(range, brightest - darkest);
  }
  return range;
}

void BoxFitter::drop_unlit(const BoxPixel& pixel, BoxFit& fit) const {
  bool dropped = false;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    if (!box.seen || lit_range(pixel, m) > kUnlit) continue;
    box.seen = false;
    box.misread = dropped = true;
  }
  if (dropped) sums_.fit_light(v_, fit.straight > 0.0, fit);
}

bool BoxFitter::reads_otherwise(const BoxFit& fit, size_t m) {
  std::array<double, WaveAxis::kMaxWaves> v;
  Parts parts;
  const PixelBox& box = fit.boxes[m];
  observe(fit, m);
  for (size_t a = 0; a < 2; ++a) {
    means(m, a, box, parts, v);
    const double apart_px = kApart * axes_[m][a].finest_bar_px();
    const double own = misfit(seen_[a], v);
    for (const double place_px :
         axes_[m][a].misreadings(seen_[a], v, box.side[a].centre_px(), apart_px, kSurely)) {
      PixelBox moved = box;
      const double half_px = 0.5 * box.side[a].length_px();
      moved.side[a] = {.low_px = place_px - half_px, .high_px = place_px + half_px};
      if (!moved.soft) moved.side[a] = inside(moved.side[a], extent_px(monitors_[m], a));
      means(m, a, moved, parts, v);
      if (misfit(seen_[a], v) < own + kSurely) return true;
    }
  }
  return false;
}

void BoxFitter::read_again(const BoxPixel& pixel, BoxFit& fit) {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    PixelBox& box = fit.boxes[m];
    if (!box.seen) continue;
    // At a wrong place nothing is left.
    box.misread = *std::ranges::max_element(box.weight) <= 0.0 || lit_range(pixel, m) < kSeparable ||
                  reads_otherwise(fit, m);
  }
}

bool BoxFitter::is_certain(const BoxFit& fit) {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (fit.boxes[m].seen && reads_otherwise(fit, m)) return false;
  }
  return true;
}

void BoxFitter::start_from(const BoxFit& other, BoxFit& fit) const {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    // A box's corners look like a narrow halo.
    const PixelBox& own = other.boxes[m];
    const double halo = halo_widths_px_[m].empty() ? 0.0 : own.halo[0], core = own.core();
    for (size_t a = 0; a < 2; ++a) {
      const double halo_px = halo > 0.0 ? halo_side(m, 0, own.side[a]).length_px() : 0.0;
      const double half_px =
          0.5 *
          std::sqrt((core * std::pow(own.side[a].length_px(), 2) + halo * halo_px * halo_px) / (core + halo));
      const double centre_px = own.side[a].centre_px();
      fit.boxes[m].side[a] =
          inside({.low_px = centre_px - half_px, .high_px = centre_px + half_px}, extent_px(monitors_[m], a));
    }
  }
}

BoxFit BoxFitter::fit_whole(const BoxFit& start) {
  const std::optional<BoxFit> soft = decoded(start);
  BoxFit box = start;
  // Of a wide footprint, a box in the matte shows more than the box that is nearest to a Gaussian.
  const bool wide = soft && !narrower(*soft, kMaxSoft);
  // The decoded position is right unless noise decides it, the footprint is wide, or there are several.
  const bool certain = soft && !wide && is_certain(*soft), enough = certain && explains(*soft);
  const bool explained = enough && narrower(*soft, kNarrow);
  if (soft) start_from(*soft, box);
  settle(!explained, false, box);
  if (!soft || wide) return box;
  // The matte shows a Gaussian as a box, so that it and its halos have to explain more than one at the same
  // place. A box that was looked for everywhere has to explain more than one at a certain position, unless
  // neither explains the pixel.
  const bool same_place = near(box, *soft), refuted = !explains(*soft) && explains(box);
  const double count = box.sample_count;
  const double gain = count * std::log(box.chi_square) - count * std::log(soft->chi_square);
  const double price = same_place || !certain ? kSoftPrice * (1.0 + halo_count(*soft)) * std::log(count)
                       : explains(*soft)      ? 0.0
                                              : kClearly;
  const bool better = !refuted && (gain > price || (enough && !same_place));
  return better ? *soft : box;
}

BoxFit BoxFitter::partly_covered(const BoxPixel& pixel, const BoxFit& start, const BoxFit& like,
                                 double straight) {
  BoxFit partly = start;
  partly.straight = straight;
  start_from(like, partly);
  for (size_t m = 0; m < monitors_.size(); ++m) {
    for (size_t p = 0; p < pixel.samples[m].size(); ++p) {
      if (monitors_[m].patterns[p].axis != BoxPattern::kSolid) continue;
      for (size_t c = 0; c < kChannels; ++c) {
        const double light = monitors_[m].patterns[p].light[c];
        if (light > 0.0)
          partly.boxes[m].weight[c] =
              std::max(start.boxes[m].weight[c] - straight * pixel.samples[m][p].straight[c] / light, 0.0);
      }
    }
  }
  settle(true, true, partly);
  return partly;
}

bool BoxFitter::may_be_covered(const BoxPixel& pixel, const BoxFit& fit) const {
  double contrast = 0.0;
  for (size_t m = 0; m < monitors_.size(); ++m) {
    for (size_t c = 0; c < pixel.channel_count(); ++c)
      contrast += spread_of(monitors_[m], pixel.samples[m], c, &BoxSample::straight);
  }
  return fit.chi_square > std::max(kPoor * fit.sample_count, kLeastLeft * kLeastLeft * contrast);
}

void BoxFitter::try_partial_cover(const BoxPixel& pixel, const BoxFit& start, BoxFit& best) {
  const double count = best.sample_count;
  double enough = best.chi_square * std::exp(-kCriterion * std::log(count) / count);
  for (const double straight : kStraightStarts) {
    const BoxFit partly = partly_covered(pixel, start, best, straight);
    if (partly.chi_square > kHopeless * enough) break;
    if (partly.chi_square >= enough || partly.straight <= 0.0) continue;
    enough = partly.chi_square;
    best = partly;
  }
}

bool BoxFitter::find_exact_cover(const BoxPixel& pixel, const BoxFit& start, BoxFit& best) {
  sums_.gather(pixel, 0.0);
  BoxFit exact = best;
  see(exact);
  sums_.fit_light(v_, true, exact);
  const double rough = exact.straight, first = exact.chi_square;
  for (size_t i = 0; i < kStraightSteps.size() && !explains(exact); ++i) {
    if (i == kFirstSteps && exact.chi_square > 0.5 * first) break;
    const double straight = std::clamp(rough + kStraightSteps[i], 0.0, 1.0);
    const BoxFit next = partly_covered(pixel, start, exact, straight);
    if (next.chi_square < exact.chi_square && next.straight > 0.0) exact = next;
  }
  if (!explains(exact)) return false;
  shorten(pixel, exact);
  best = exact;
  return true;
}

void BoxFitter::shorten(const BoxPixel& pixel, BoxFit& best) {
  double strongest = 0.0;
  for (const PixelBox& box : best.boxes)
    strongest = std::max(strongest, *std::ranges::max_element(box.weight));
  sums_.gather(pixel, std::pow(kAlike * strongest, 2.0));
  BoxFit shorter = best;
  settle(true, true, shorter);
  sums_.gather(pixel, 0.0);
  settle(false, true, shorter);
  if (shorter.chi_square < best.chi_square + kSurely) best = shorter;
}

BoxFit BoxFitter::fit(const BoxPixel& pixel) {
  BoxFit start;
  begin(pixel, start);
  sums_.gather(pixel, 0.0);
  if (std::ranges::none_of(start.boxes, &PixelBox::seen)) {
    sums_.fit_light(v_, false, start);
    start.rms = rms_of(pixel, start);
    return start;
  }
  BoxFit best = fit_whole(start);
  const bool cover = pixel.has_straight && may_be_covered(pixel, best);
  if (!explains(best)) {
    see(best);
    sums_.gather(pixel, misfit_of(pixel, best));
    settle(false, false, best);
  }
  if (cover) try_partial_cover(pixel, start, best);
  if (best.straight > 0.0 && !find_exact_cover(pixel, start, best)) {
    see(best);
    sums_.gather(pixel, misfit_of(pixel, best));
    settle(false, true, best);
  }
  see(best);
  drop_unlit(pixel, best);
  best.rms = rms_of(pixel, best);
  sums_.gather(pixel, shape_error_of(pixel, best));
  estimate_errors(best);
  best.cover_unsure = 2.0 * best.straight_sd > kCoverError;
  read_again(pixel, best);
  return best;
}

std::optional<double> BoxFitter::leftover(const BoxPixel& pixel) {
  BoxFit start;
  begin(pixel, start);
  const auto seen = static_cast<double>(std::ranges::count_if(start.boxes, &PixelBox::seen));
  if (seen == 0.0) return std::nullopt;
  sums_.gather(pixel, 0.0);
  const BoxFit fit = fit_whole(start);
  // Of a box its sides, of each channel F and R.
  const double parameters =
      4.0 * seen + (1.0 + seen) * static_cast<double>(pixel.channel_count()) + halo_count(fit);
  return fit.chi_square / std::max(fit.sample_count - parameters, 1.0);
}

void BoxFitter::slopes(size_t m, const PixelBox& box, WaveSums::Slopes& slopes) const {
  for (size_t a = 0; a < 2; ++a) {
    const WaveAxis& axis = axes_[m][a];
    const Interval& side = box.side[a];
    const WaveAxis::SoftMeans soft = axis.soft_means(soft_side(side));
    for (size_t k = 0; k < axis.wave_count(); ++k) {
      const size_t i = sums_.first_wave(m, a) + k;
      if (box.soft) {
        const double by_t = 0.5 * box.core() * soft.by_t[k],
                     by_width = box.core() * soft.by_sigma[k] / kSidePerSigma;
        slopes[i] = {by_t - by_width, by_t + by_width};
      } else {
        const double v = v_[m][i], scale = 1.0 / side.length_px();
        slopes[i] = {scale * (v - axis.wave_at(k, side.low_px)), scale * (axis.wave_at(k, side.high_px) - v)};
      }
    }
  }
}

void BoxFitter::estimate_errors(BoxFit& fit) {
  for (size_t m = 0; m < monitors_.size(); ++m) {
    if (fit.boxes[m].seen) slopes(m, fit.boxes[m], slopes_[m]);
  }
  sums_.estimate_errors(v_, slopes_, finest_bars_px_, fit);
}

}  // namespace glasswing
