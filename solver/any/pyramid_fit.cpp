#include "solver/any/pyramid_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

#include "solver/any/positive_fit.h"

namespace glasswing {
namespace {

constexpr double kPrior = 8.0;          // of a coefficient, over the density of light
constexpr double kWider = 2.0;          // than the modes in variance: where their light may be, and
constexpr size_t kFewDirections = 4;    // that leave shapes open
constexpr double kBlur_px2 = 4.0;       // of that density
constexpr double kReach = 3.0;          // of a footprint: standard deviations beside its mean, and
constexpr double kMargin_px = 2.0;      // this much
constexpr size_t kMaxPlaces = 2000;     // that take part; beyond that the narrowest level is left out
constexpr size_t kMaxKnown = 20000;     // answers kept
constexpr double kBoundNoise = 4.0;     // standard deviations of a sample by which it bounds a coefficient
constexpr float kMinAnswer = 0.02f;     // of a place's highest answer: samples below bound nothing
constexpr double kMinOfPrior = 0.02;    // of an even prior: a coefficient that must be smaller is 0
constexpr double kMinPrior = 1e-3;      // of an even one: places of less have no light
constexpr float kDark = 1e-4f;          // of the highest answer: samples below tell of F alone
constexpr double kModeFreedom = 5.0;    // of the samples, that a mode takes: its place and widths
constexpr double kToll = 0.3;           // noise adds no light where half of the places are bright
constexpr double kTemper = 20.0;        // of log evidence, which neglects that coefficients are positive
constexpr double kMaxDispersion = 1.5;  // chi2 per degree of freedom; beyond it samples are weighed anew,
constexpr int kMaxWeighings = 3;        // so often
constexpr double kRounding = 1e-9;      // of chi2

// The place and widths of all light.
struct Extent {
  double weight = 0.0, x_px = 0.0, y_px = 0.0, xx_px2 = 0.0, yy_px2 = 0.0;
};

Extent extent_of(const Footprints& modes) {
  Extent all;
  for (const Footprint& mode : modes) {
    all.weight += mode.weight;
    all.x_px += mode.weight * mode.x_px;
    all.y_px += mode.weight * mode.y_px;
  }
  if (!(all.weight > 0.0)) return {};
  all.x_px /= all.weight;
  all.y_px /= all.weight;
  for (const Footprint& mode : modes) {
    all.xx_px2 += mode.weight / all.weight * (mode.xx_px2 + std::pow(mode.x_px - all.x_px, 2));
    all.yy_px2 += mode.weight / all.weight * (mode.yy_px2 + std::pow(mode.y_px - all.y_px, 2));
  }
  return all;
}

// The density of light at the middle of `place`, blurred by it.
double density(const Footprints& modes, const Footprint& place) {
  double sum = 0.0;
  for (const Footprint& mode : modes) {
    const double xx = mode.xx_px2 + place.xx_px2 + kBlur_px2, yy = mode.yy_px2 + place.yy_px2 + kBlur_px2,
                 xy = mode.xy_px2, determinant = xx * yy - xy * xy, x = place.x_px - mode.x_px,
                 y = place.y_px - mode.y_px;
    sum += mode.weight / (2.0 * std::numbers::pi * std::sqrt(determinant)) *
           std::exp(-0.5 * (x * x * yy - 2.0 * x * y * xy + y * y * xx) / determinant);
  }
  return sum;
}

Footprints widened(Footprints modes) {
  for (Footprint& mode : modes) {
    mode.xx_px2 *= kWider;
    mode.xy_px2 *= kWider;
    mode.yy_px2 *= kWider;
  }
  return modes;
}

// Stripes and waves.
size_t directions_of(const std::vector<ShownPattern>& patterns) {
  std::set<long> found;
  for (const ShownPattern& own : patterns) {
    if (own.kind == ShownPattern::Kind::kArea) continue;
    const bool is_wave = own.kind == ShownPattern::Kind::kWave;
    const double turn_rad =
        is_wave ? std::atan2(own.fy, own.fx) : std::atan2(own.axis.sin_phi, own.axis.cos_phi);
    found.insert(std::lround(180.0 / std::numbers::pi * (turn_rad + 2.0 * std::numbers::pi)) % 180);
  }
  return found.size();
}

PyramidFitter::Range reached(double centre_px, double variance_px2, double size_px) {
  const double reach = kReach * std::sqrt(variance_px2) + kMargin_px;
  return {std::max(centre_px - reach, 0.0), std::min(centre_px + reach, size_px)};
}

void add_places(int level, const PyramidFitter::Range& x, const PyramidFitter::Range& y,
                std::vector<Coefficient>& places) {
  const double step = std::ldexp(2.0, level);
  for (int row = static_cast<int>(y.low_px / step); (row + 0.5) * step < y.high_px + 0.5 * step; ++row) {
    for (int column = static_cast<int>(x.low_px / step); (column + 0.5) * step < x.high_px + 0.5 * step;
         ++column)
      places.push_back({.level = level, .column = column, .row = row, .weight = 0.0f});
  }
}

}  // namespace

PyramidFitter::PyramidFitter(const PatternLanes& patterns)
    : patterns_(patterns),
      extent_(patterns.answers().extent()),
      few_directions_(directions_of(patterns.answers().patterns()) <= kFewDirections),
      values_(patterns.pattern_count()),
      answer_(patterns.size()) {}

const std::vector<float>& PyramidFitter::answer(const Footprint& footprint) {
  patterns_.answers().values(footprint, values_.data());
  for (size_t i = 0; i < values_.size(); ++i) answer_[patterns_.lane(i)] = static_cast<float>(values_[i]);
  return answer_;
}

const float* PyramidFitter::answer(const Coefficient& place) {
  const std::int64_t key = (std::int64_t{place.level} << 40) + (std::int64_t{place.column} << 20) + place.row;
  const auto [at, is_new] = known_.try_emplace(key);
  if (is_new) {
    Coefficient whole = place;
    whole.weight = 1.0f;
    at->second = answer(footprint_of(mode_of(whole, 0)));
  }
  return at->second.data();
}

double PyramidFitter::gaussians_chi2(const MixtureLanes& samples, const Footprints& near) {
  const auto lanes = static_cast<Eigen::Index>(patterns_.size());
  const auto lanes_of = [&](const std::vector<float>& all) {
    return Eigen::Map<const Eigen::ArrayXf>(all.data(), lanes);
  };
  Eigen::ArrayXf rest = lanes_of(samples.y);
  for (const Footprint& mode : near) rest -= lanes_of(samples.peak) * lanes_of(answer(mode));
  const auto floor = static_cast<float>((rest * lanes_of(samples.root)).sum() / samples.information);
  return static_cast<double>((rest - floor * lanes_of(samples.root)).square().sum());
}

std::vector<PyramidFitter::Place> PyramidFitter::places_of(const MixtureLanes& samples,
                                                           const Footprints& near, const Range& across,
                                                           const Range& down, double prior_sd) {
  const Footprints expected = widened(near);
  const auto lanes = static_cast<Eigen::Index>(patterns_.size());
  const auto lanes_of = [&](const std::vector<float>& all) {
    return Eigen::Map<const Eigen::ArrayXf>(all.data(), lanes);
  };
  // Of unit weight; where nothing was measured, nothing is bounded.
  const Eigen::ArrayXf root = lanes_of(samples.root), scale = (root > 0.0f).select(root.inverse(), 0.0f),
                       peaks = lanes_of(samples.peak) * scale;
  const float black = (lanes_of(samples.y) * scale)[static_cast<Eigen::Index>(patterns_.black_lane())];
  const Eigen::ArrayXf most = lanes_of(samples.y) * scale - black + kBoundNoise * scale;
  std::vector<Place> places;
  std::vector<Coefficient> own;
  Eigen::ArrayXf light;
  for (int level = kPyramidLevels - 2; level >= 0; --level) {
    own.clear();
    add_places(level, across, down, own);
    const size_t before = places.size();
    const double even_sd = std::ldexp(prior_sd, 2 * level);
    const auto min_sd = static_cast<float>(kMinOfPrior * even_sd);
    for (const Coefficient& place : own) {
      const double own_sd =
          few_directions_
              ? even_sd
              : std::ldexp(kPrior * density(expected, footprint_of(mode_of(place, 0))), 2 * level);
      if (own_sd < kMinPrior * even_sd) continue;
      const float* const seen = answer(place);
      light = Eigen::Map<const Eigen::ArrayXf>(seen, lanes) * peaks;
      const float least = kMinAnswer * light.maxCoeff();
      if (!(least > 0.0f)) continue;
      if ((light > least && most < min_sd * light).any()) continue;
      places.push_back({place, seen, own_sd});
      if (places.size() > kMaxPlaces) break;
    }
    if (places.size() <= kMaxPlaces) continue;
    places.resize(before);
    break;
  }
  return places;
}

// The samples that see the places, whitened; those that see none of them tell about F alone, and are the
// last. Columns: F, modes, places.
struct PyramidFitter::Problem : PositiveProblem {
  size_t modes = 0;
  double chi2_apart = 0.0;  // of what any fit leaves

  Eigen::Map<const Eigen::ArrayXf> of(const float* lane) const {
    return {lane, static_cast<Eigen::Index>(lanes)};
  }
};

PyramidFitter::Problem PyramidFitter::problem_of(const MixtureLanes& samples, const Footprints& near,
                                                 const std::vector<Place>& places) {
  const auto lanes = static_cast<Eigen::Index>(patterns_.size());
  Eigen::ArrayXf most = Eigen::ArrayXf::Zero(lanes);
  for (const Place& place : places) most = most.max(Eigen::Map<const Eigen::ArrayXf>(place.answer, lanes));
  const float least = kDark * most.maxCoeff();
  std::vector<size_t> seeing;
  double dark_weight = 0.0, dark = 0.0, dark_square = 0.0;
  for (size_t k = 0; k < patterns_.size(); ++k) {
    const double root = samples.root[k], y = samples.y[k];
    if (!(root > 0.0)) continue;
    if (most[static_cast<Eigen::Index>(k)] > least) {
      seeing.push_back(k);
    } else {
      dark_weight += root * root;
      dark += root * y;
      dark_square += y * y;
    }
  }
  Problem own;
  own.samples = seeing.size() + 1;
  own.lanes = (own.samples + PatternLanes::kPad - 1) / PatternLanes::kPad * PatternLanes::kPad;
  own.modes = static_cast<size_t>(near.size());
  own.toll = kToll;
  own.a.reserve((1 + own.modes + places.size()) * own.lanes);
  const auto add = [&](const float* answers, const std::vector<float>& scale, double prior_sd) {
    float* const at = &*own.a.insert(own.a.end(), own.lanes, 0.0f);
    for (size_t i = 0; i < seeing.size(); ++i) at[i] = answers[seeing[i]] * scale[seeing[i]];
    own.prior_sd.push_back(prior_sd);
  };
  add(std::vector<float>(patterns_.size(), 1.0f).data(), samples.root, 1.0);
  own.y.resize(own.lanes);
  for (size_t i = 0; i < seeing.size(); ++i) own.y[i] = samples.y[seeing[i]];
  if (dark_weight > 0.0) {
    const double dark_root = std::sqrt(dark_weight), y = dark / dark_root;
    own.a[seeing.size()] = static_cast<float>(dark_root);
    own.y[seeing.size()] = static_cast<float>(y);
    own.chi2_apart = dark_square - y * y;
  }
  const double mode_sd = 1.0 / std::sqrt(kModeFreedom * std::log(static_cast<double>(own.samples)));
  for (const Footprint& mode : near) add(answer(mode).data(), samples.peak, mode_sd);
  for (const Place& place : places) add(place.answer, samples.peak, place.prior_sd);
  return own;
}

// Of the fit of modes and places together and of the modes as they are.
struct PyramidFitter::Average {
  Average(const Problem& problem, std::vector<size_t> start, bool few_directions)
      : modes(static_cast<double>(problem.modes)),
        samples(static_cast<double>(problem.samples)),
        root(Eigen::ArrayXf::Ones(static_cast<Eigen::Index>(problem.lanes))) {
    leave_modes(problem);
    fit(problem, start);
    for (int i = 0; i < kMaxWeighings && !explains(); ++i) weigh_anew(problem);
    share = by_prediction();
    if (few_directions) share *= by_evidence();
  }

  double chi2() const {
    return static_cast<double>(((1.0f - kept()) * rest + kept() * rest_of_modes).square().sum());
  }

  PositiveFit both;
  double floor_of_modes = 0.0;  // F
  double share = 0.0;           // of the modes as they are

 private:
  float kept() const { return static_cast<float>(share); }

  void leave_modes(const Problem& problem) {
    rest_of_modes = problem.of(problem.y.data());
    for (size_t k = 1; k <= problem.modes; ++k) rest_of_modes -= problem.of(problem.column(k));
    const Eigen::ArrayXf even = problem.of(problem.column(0));
    information = static_cast<double>(even.square().sum());
    floor_of_modes = static_cast<double>((even * rest_of_modes).sum()) / information;
    rest_of_modes -= static_cast<float>(floor_of_modes) * even;
  }

  void fit(const Problem& problem, const std::vector<size_t>& start) {
    both = positive_minimum(problem, 1, problem.size(), start);
    rest = problem.of(both.residual.data()) / root;
    used = 0.0;
    for (size_t i = 1; i < both.above.size(); ++i) {
      if (both.above[i].column <= problem.modes) used += std::min(both.above[i].x, 1.0);
    }
  }

  bool explains() const {
    return static_cast<double>(rest.square().sum()) < kMaxDispersion * (samples - both.freedom);
  }

  // Of weights, as if noise had Cauchy's tails.
  static Eigen::ArrayXf tolerant_root(const Eigen::ArrayXf& square) {
    return (2.0f / (1.0f + square)).min(1.0f).sqrt();
  }

  // Samples that the fit or the modes do not explain get less weight in the next fit.
  void weigh_anew(const Problem& problem) {
    root = tolerant_root(rest.square().max(rest_of_modes.square()));
    Problem weighed = problem;
    const auto weigh = [&](float* column) { Eigen::Map<Eigen::ArrayXf>(column, root.size()) *= root; };
    for (size_t k = 0; k < problem.size(); ++k) weigh(&weighed.a[k * problem.lanes]);
    weigh(weighed.y.data());
    std::vector<size_t> start;
    for (size_t i = 1; i < both.above.size(); ++i) start.push_back(both.above[i].column);
    fit(weighed, start);
  }

  // Samples leave open which of the two is right; the one that fits fewer values to them is likelier.
  double by_evidence() const {
    const double left = static_cast<double>((root * rest_of_modes).square().sum()),
                 of_modes =
                     -0.5 * (left + std::log(information) + (1.0 + kModeFreedom) * modes * std::log(samples));
    return 1.0 / (1.0 + std::exp((both.evidence - of_modes) / kTemper));
  }

  double by_prediction() const {
    // Samples that one of them explains count in full.
    const bool is_explained = root.minCoeff() == 1.0f;
    const Eigen::ArrayXf own = is_explained ? root : tolerant_root(rest.square().min(rest_of_modes.square()));
    const Eigen::ArrayXd off = (own * rest).cast<double>(),
                         differ = (own * rest_of_modes).cast<double>() - off;
    const double more = both.freedom + kModeFreedom * used - 1.0 - (1.0 + kModeFreedom) * modes,
                 noise = off.square().sum() / (samples - both.freedom);
    return std::clamp((noise * more - (off * differ).sum()) / std::max(differ.square().sum(), kRounding), 0.0,
                      1.0);
  }

  double modes, samples;
  double information = 0.0;  // about F
  double used = 0.0;         // of the modes, by the fit of both
  Eigen::ArrayXf root;       // of the samples' weights, beside their own
  Eigen::ArrayXf rest, rest_of_modes;
};

std::optional<PyramidFit> PyramidFitter::fit(const MixtureLanes& samples, const Footprints& near,
                                             const std::vector<Coefficient>& like) {
  const Extent light = extent_of(near);
  if (!(light.weight > 0.0)) return std::nullopt;
  const Range across = reached(light.x_px, light.xx_px2, extent_.width_px),
              down = reached(light.y_px, light.yy_px2, extent_.height_px);
  const double area_px2 = (across.high_px - across.low_px) * (down.high_px - down.low_px) / (kReach * kReach);
  if (!(area_px2 > 0.0)) return std::nullopt;
  const double prior_sd = kPrior * light.weight / area_px2;
  if (known_.size() > kMaxKnown) known_.clear();
  const std::vector<Place> places = places_of(samples, near, across, down, prior_sd);
  if (places.empty()) return std::nullopt;
  const Problem all = problem_of(samples, near, places);
  const size_t first = 1 + all.modes;
  std::vector<size_t> start(all.modes);
  std::iota(start.begin(), start.end(), size_t{1});
  for (const Coefficient& own : like) {
    const auto at = std::ranges::find_if(places, [&](const Place& place) {
      return place.at.level == own.level && place.at.column == own.column && place.at.row == own.row;
    });
    if (at != places.end()) start.push_back(first + static_cast<size_t>(at - places.begin()));
  }
  const Average average(all, start, few_directions_);
  PyramidFit fit{
      .coefficients = {},
      .modes = std::vector<double>(all.modes, average.share),
      .floor = (1.0 - average.share) * average.both.above[0].x + average.share * average.floor_of_modes,
      .chi2 = average.chi2() + all.chi2_apart,
      .prior_sd = prior_sd,
      .gaussian = average.share};
  for (size_t i = 1; i < average.both.above.size(); ++i) {
    const size_t column = average.both.above[i].column;
    const double x = (1.0 - average.share) * average.both.above[i].x;
    if (column < first) {
      fit.modes[column - 1] += x;
      continue;
    }
    Coefficient own = places[column - first].at;
    own.weight = static_cast<float>(x);
    if (own.weight > 0.0f) fit.coefficients.push_back(own);
  }
  return fit;
}

}  // namespace glasswing
