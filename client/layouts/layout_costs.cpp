#include "client/layouts/layout_costs.h"

#include <algorithm>
#include <cmath>

#include "core/base/median.h"

namespace glasswing {
namespace {

constexpr double kBad = 0.75;  // in the worst cost

// What a picture of half the solid's light, or of patterns, differs by is several of these.
constexpr double kSolidSlack = 0.2, kSolidSd = 0.08;
constexpr double kAlongAxis = 0.8;  // of all edges
constexpr double kAlongAxisSd = 0.1;
constexpr double kOctaveSd = 0.35;       // of the number of edges, for what noise and objects do to it
constexpr double kMaxDensity = 0.2;      // edges a pixel; above it they blur into one another
constexpr double kResolved = 0.6;        // contrast of fine bars whose edges can be counted
constexpr double kManyEdges = 4.0;       // on a line; such bars may be too fine for the camera
constexpr double kMostAtCoarsest = 1.8;  // log2 of its edges on a line
constexpr double kComplement = 0.2, kComplementSd = 0.05, kSurelyComplements = 0.15;
constexpr double kResidualSd = 0.08, kMeanSd = 0.15, kCoherenceSd = 0.2, kAmplitudeSd = 0.5;
// A quarter of a period has 40 %; bars have hardly others.
constexpr double kFewPhases = 0.4, kFewPhasesSd = 0.1;
// Two steps of three sum to half of their variances, bars and their complements to none.
constexpr double kLeastSum = 0.3, kLeastSumSd = 0.05;
constexpr double kLeastAmplitude = 0.2, kLeastAmplitudeSd = 0.04;
// Where all phases are seen, all steps vary alike.
constexpr double kAllPhases = 0.2, kLeastVariance = 0.6, kLeastVarianceSd = 0.1;
constexpr double kPromising = 0.5;  // coherence of waves that may have a bad photograph
constexpr double kWrongAxis = 8.0;
constexpr double kTurnAlongAxis = 1.5;
constexpr double kEqualPeriods = 0.005;

double square(double value) {
  return value * value;
}

// `edges`: how many should lie on a line.
double cost_of(const PatternView::Look& look, size_t axis, double edges) {
  const bool fine = edges >= kManyEdges;
  if (!look.has_bars()) {
    if (look.high - look.low >= PatternView::kMinContrast) return fine ? 0.5 : 3.0;
    const double level = 0.5 * (look.low + look.high);
    const bool gray = level > 0.25 && level < 0.75;
    if (edges < 1.0) return gray ? 3.0 : 2.0;  // the camera may see one bar alone
    if (!fine) return 4.0;
    return gray ? 0.5 : level > 0.5 ? 2.0 : 4.0;  // saturated bars are white
  }
  if (fine && look.high - look.low < kResolved && look.low > 0.1 && look.high < 0.9) return 1.0;
  const double own = look.density[axis], other = look.density[1 - axis];
  if (look.edges[axis] < 0.5 && edges < 1.5) return look.edges[1 - axis] > 1.0 ? 3.5 : 0.5;
  const double share = own / std::max(own + other, 1e-9);
  const double along = std::max(0.0, kAlongAxis - share) / kAlongAxisSd;
  if (own > kMaxDensity) return std::min(along + 0.3, LayoutCosts::kWorst);
  const double octaves = std::log2((look.edges[axis] + 0.5) / (edges + 0.5));
  return std::min(along + 0.5 * square(octaves / kOctaveSd), LayoutCosts::kWorst);
}

double below(double value, double least, double sd) {
  return square(std::max(0.0, least - value) / sd);
}

double cost_of(const PatternView::Fringe& fringe, size_t axis) {
  const bool across = std::abs(fringe.turn_rad[axis]) > kTurnAlongAxis * std::abs(fringe.turn_rad[1 - axis]);
  return 0.5 *
             (square(fringe.residual / kResidualSd) + square(fringe.mean_spread / kMeanSd) +
              square((1.0 - fringe.coherence[axis]) / kCoherenceSd) +
              square(fringe.amplitude_spread / kAmplitudeSd) +
              below(fringe.amplitude, kLeastAmplitude, kLeastAmplitudeSd) +
              below(fringe.least_sum, kLeastSum, kLeastSumSd) +
              (fringe.few_phases < kAllPhases ? below(fringe.least_variance, kLeastVariance, kLeastVarianceSd)
                                              : 0.0) +
              square(std::max(0.0, fringe.few_phases - kFewPhases) / kFewPhasesSd)) +
         (across ? 0.0 : kWrongAxis);
}

}  // namespace

double LayoutCosts::solid(int photograph, bool white) const {
  const PatternView::Look& look = view_.look(photograph);
  const double off = white ? 1.0 - look.low : look.high;
  return std::clamp((off - kSolidSlack) / kSolidSd, 0.0, kWorst);
}

double LayoutCosts::complement_error(int photograph) {
  const auto [known, fresh] = complement_errors_.try_emplace(photograph, 0.0);
  if (fresh) known->second = view_.complement_error(photograph, photograph + 1);
  return known->second;
}

std::vector<double> LayoutCosts::costs_of_bars(size_t axis, int first, int bits, bool pairs) {
  const int shots = pairs ? 2 : 1;
  std::vector<double> octaves;  // of edges on a line, those of the coarsest bars for all
  for (int i = 0; i < bits * shots; ++i) {
    const PatternView::Look& look = view_.look(first + i);
    if (look.has_bars() && look.edges[axis] >= 1.0 && look.density[axis] <= kMaxDensity)
      octaves.push_back(std::log2(look.edges[axis]) - i / shots);
  }
  const double coarsest = octaves.empty() ? 0.0 : median(octaves);
  std::vector<double> costs;
  for (int i = 0; i < bits * shots; ++i)
    costs.push_back(cost_of(view_.look(first + i), axis, std::exp2(coarsest + i / shots)));
  costs.front() += 2.0 * square(std::max(0.0, coarsest - kMostAtCoarsest));
  for (int i = 0; i + 1 < bits * shots; i += shots) {
    const PatternView::Look &one = view_.look(first + i), &other = view_.look(first + i + 1);
    // White and black are no fine bars.
    const bool solids = std::max(one.low, other.low) > 0.75 && std::min(one.high, other.high) < 0.25;
    if (pairs && solids && i / shots > 1) costs[i] += kWorst;
    if (!one.has_bars() || !other.has_bars()) continue;
    const double error = complement_error(first + i);
    double& cost = costs[i];
    if (pairs) cost += std::clamp((error - kComplement) / kComplementSd, 0.0, kWorst);
    if (!pairs && error < kSurelyComplements) cost += 4.0;
  }
  return costs;
}

double LayoutCosts::bars(size_t axis, int first, int bits, bool pairs) {
  const auto [known, fresh] = bars_.try_emplace({axis, first, bits, pairs}, 0.0);
  if (fresh) {
    for (const double cost : costs_of_bars(axis, first, bits, pairs)) known->second += cost;
  }
  return known->second;
}

std::vector<int> LayoutCosts::bad_bars(size_t axis, int first, int bits, bool pairs) {
  std::vector<int> bad;
  const std::vector<double> costs = costs_of_bars(axis, first, bits, pairs);
  for (size_t i = 0; i < costs.size(); ++i) {
    if (costs[i] >= kBad * kWorst) bad.push_back(first + static_cast<int>(i));
  }
  return bad;
}

int LayoutCosts::left_out(int first, int steps) const {
  const auto known = waves_.find({first, steps});
  return known == waves_.end() ? -1 : known->second.left_out;
}

double LayoutCosts::wave(size_t axis, int first, int steps) {
  const auto [known, fresh] = waves_.try_emplace({first, steps}, Wave{});
  if (!fresh) return known->second.costs[axis];
  std::array<double, 2>& costs = known->second.costs;
  const PatternView::Fringe whole = view_.fringe(first, steps);
  std::vector<double> edges;  // on a line; all steps have as many
  for (int k = 0; k < steps; ++k) {
    const PatternView::Look& look = view_.look(first + k);
    edges.push_back(std::log2(std::max(look.edges[0], look.edges[1]) + 1.0));
  }
  const double usual = median(edges);
  const auto uneven = [&](int left_out) {
    double most = 0.0;
    for (int k = 0; k < steps; ++k) {
      if (k != left_out) most = std::max(most, square((edges[k] - usual) / kOctaveSd));
    }
    return 0.5 * most;
  };
  for (size_t along = 0; along < 2; ++along) costs[along] = cost_of(whole, along) + uneven(-1);
  // One photograph may be bad.
  const bool promising = *std::ranges::min_element(costs) > kWorst && whole.coherence[0] > kPromising &&
                         whole.coherence[1] > kPromising;
  for (int k = 0; promising && steps >= 4 && k < steps; ++k) {
    const PatternView::Fringe others = view_.fringe(first, steps, k);
    const double before = *std::ranges::min_element(costs);
    for (size_t along = 0; along < 2; ++along)
      costs[along] = std::min(costs[along], kWorst + cost_of(others, along) + uneven(k));
    if (*std::ranges::min_element(costs) < before) known->second.left_out = k;
  }
  for (double& cost : costs) cost = std::min(cost, kWorst * steps);
  return costs[axis];
}

double LayoutCosts::fringes(size_t axis, int first, int steps, int waves, double most) {
  double cost = 0.0;
  for (int w = 0; w < waves && cost <= most; ++w) cost += wave(axis, first + w * steps, steps);
  if (cost > std::min(most, kWorst * waves)) return cost;
  for (int a = 0; a < waves; ++a) {
    const double turn = view_.fringe(first + a * steps, steps).turn_rad[axis];
    for (int b = a + 1; b < waves; ++b) {
      const double beat = view_.beat_rad(first + a * steps, first + b * steps, steps, axis);
      if (std::abs(beat) < kEqualPeriods * std::abs(turn)) cost += kWorst * steps;
    }
  }
  return cost;
}

}  // namespace glasswing
