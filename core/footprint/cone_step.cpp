#include "core/footprint/cone_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

struct Direction {
  double c, s;
  Direction turned(const Direction& by) const { return {c * by.c - s * by.s, s * by.c + c * by.s}; }
};
Direction direction(double angle) {
  return {std::cos(angle), std::sin(angle)};
}

// Of twice an angle, over a whole turn: where a search begins, and its steps, each half of the one before.
constexpr int kDirections = 12, kHalvings = 11;
const auto kStarts = [] {
  std::array<Direction, kDirections> starts;
  for (int i = 0; i < kDirections; ++i) starts[i] = direction(2.0 * i * std::numbers::pi / kDirections);
  return starts;
}();
const auto kTurns = [] {
  std::array<Direction, kHalvings> turns;
  double angle = std::numbers::pi / kDirections;
  for (Direction& turn : turns) turn = direction(angle), angle *= 0.5;
  return turns;
}();

// The positive semi-definite (xx, xy, yy) nearest to `target` in the metric H: rank one, a multiple of
// (c^2, cs, s^2) = (1 + C, S, 1 - C) / 2 of its direction, with C and S of twice its angle. Its gain is the
// square of a linear form of C and S over a quadratic one.
Eigen::Vector3d nearest_positive(const Eigen::Vector3d& target, const Eigen::Matrix3d& h) {
  const Eigen::Vector3d weighted = h * target;
  const double sum = weighted[0] + weighted[2], difference = weighted[0] - weighted[2];
  const double one = h(0, 0) + 2.0 * h(0, 2) + h(2, 2), by_c = 2.0 * (h(0, 0) - h(2, 2)),
               by_s = 2.0 * (h(0, 1) + h(2, 1)), by_cc = h(0, 0) - 2.0 * h(0, 2) + h(2, 2),
               by_cs = 2.0 * (h(0, 1) - h(2, 1)), by_ss = h(1, 1);
  Direction best = kStarts[0];
  double best_gain = -1.0, best_scale = 0.0;
  const auto consider = [&](const Direction& d) {
    const double along = std::max(sum + difference * d.c + weighted[1] * d.s, 0.0),
                 square = one + (by_c + by_cc * d.c + by_cs * d.s) * d.c + (by_s + by_ss * d.s) * d.s;
    if (along * along > best_gain * square)
      best = d, best_gain = along * along / square, best_scale = along / square;
  };
  for (const Direction& start : kStarts) consider(start);
  for (const Direction& turn : kTurns) {
    const Direction middle = best;
    consider(middle.turned({turn.c, -turn.s}));
    consider(middle.turned(turn));
  }
  return best_scale * Eigen::Vector3d(1.0 + best.c, best.s, 1.0 - best.c);
}

// What the Sigma of one footprint has to do with all parameters.
struct Moved {
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kMaxParameters, 3> covariance, follow;
};

}  // namespace

ConeStep step_within_cone(const Footprints& modes, const FootprintCholesky& factor,
                          const FootprintVector& whole_step) {
  FootprintVector step = whole_step;
  std::array<Moved, kMaxFootprints> moved_sigmas;
  size_t moved_count = 0;
  for (int m = 0; m < modes.size(); ++m) {
    const Footprint& mode = modes[m];
    const Eigen::Vector3d now(mode.xx_px2, mode.xy_px2, mode.yy_px2);
    const Eigen::Index block = 6 * m + 3;
    const Eigen::Vector3d free = now + step.segment<3>(block);
    if (free[0] >= 0.0 && free[2] >= 0.0 && free[0] * free[2] >= free[1] * free[1]) continue;
    Moved& own = moved_sigmas[moved_count++];
    own.covariance = factor.inverse_columns(block).leftCols<3>();
    // Of the parameters that are still free: without the Sigmas that moved before.
    for (size_t before = 0; before + 1 < moved_count; ++before) {
      const Moved& other = moved_sigmas[before];
      own.covariance -= other.follow * other.covariance.middleRows<3>(block).transpose();
    }
    const Eigen::Matrix3d metric = Eigen::Matrix3d(own.covariance.middleRows<3>(block)).inverse();
    own.follow = own.covariance * metric;
    step += own.follow * (nearest_positive(free, metric) - free);
  }
  Footprints moved = modes;
  for (int m = 0; m < modes.size(); ++m) {
    Footprint& mode = moved[m];
    const double* d = step.data() + 6 * m;
    mode.weight += d[0];
    mode.x_px += d[1];
    mode.y_px += d[2];
    mode.xx_px2 += d[3];
    mode.xy_px2 += d[4];
    mode.yy_px2 += d[5];
  }
  return {.modes = moved, .step = step};
}

}  // namespace glasswing
