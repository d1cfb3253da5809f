#include "solver/mosaic/edge_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "core/matte/matte.h"

namespace glasswing {
namespace {

constexpr int kTurns = 32;               // directions that are tried
constexpr size_t kEdges = 25;            // and distances
constexpr double kStepPx = 0.25;         // between distances
constexpr double kSampleNearness = 0.6;  // samples count exp(-that r^2), r in px
constexpr double kLeaning = 0.02;        // per px^2 between two channels' edges

double distance_px(size_t edge) {
  return kStepPx * (static_cast<double>(edge) - (kEdges - 1) / 2.0);
}

using Costs = std::array<double, kEdges>;  // by distance

struct Best {
  size_t edge = 0;
  double cost = INFINITY;
};
// `leant_on`: the distance that others lean to; null: none.
Best best_of(const Costs& costs, const Best* leant_on) {
  Best best;
  for (size_t e = 0; e < kEdges; ++e) {
    const double away_px = leant_on != nullptr ? distance_px(e) - distance_px(leant_on->edge) : 0.0;
    const double cost = costs[e] + kLeaning * away_px * away_px;
    if (cost < best.cost) best = {.edge = e, .cost = cost};
  }
  return best;
}

// One direction of the edge.
struct Direction {
  explicit Direction(int turn)
      : x(std::cos(2.0 * std::numbers::pi * turn / kTurns)),
        y(std::sin(2.0 * std::numbers::pi * turn / kTurns)),
        slope(1.0 / (std::abs(x) + std::abs(y))) {}
  double part(int dx, int dy, size_t edge) const {
    return std::clamp(0.5 + slope * (x * dx + y * dy - distance_px(edge)), 0.0, 1.0);
  }
  double x, y, slope;
};

}  // namespace

double part_by_edge(std::span<const EdgeSample> samples, int own, int wanted) {
  std::array<bool, kChannels> known{};
  for (const EdgeSample& sample : samples) known[sample.channel] = true;
  std::array<double, 2 * kEdgeReach * kEdgeReach + 1> near{};  // by squared distance
  for (size_t i = 0; i < near.size(); ++i) near[i] = std::exp(-kSampleNearness * static_cast<double>(i));
  double part = 0.0, least = INFINITY;
  for (int turn = 0; turn < kTurns; ++turn) {
    const Direction direction(turn);
    std::array<Costs, kChannels> costs{};
    for (const EdgeSample& sample : samples) {
      const double weight = near[sample.dx * sample.dx + sample.dy * sample.dy];
      for (size_t e = 0; e < kEdges; ++e) {
        const double miss = sample.part - direction.part(sample.dx, sample.dy, e);
        costs[sample.channel][e] += weight * miss * miss;
      }
    }
    const Best of_own = best_of(costs[own], nullptr);
    const Best* leant_on = known[own] ? &of_own : nullptr;
    Best of_wanted;
    double sum = leant_on != nullptr ? of_own.cost : 0.0;
    for (int c = 0; c < kChannels; ++c) {
      if (c == own || !known[c]) continue;
      const Best best = best_of(costs[c], leant_on);
      sum += best.cost;
      if (c == wanted) of_wanted = best;
    }
    if (sum >= least) continue;
    least = sum;
    part = direction.part(0, 0, of_wanted.edge);
  }
  return part;
}

}  // namespace glasswing
