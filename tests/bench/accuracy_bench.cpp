// Errors relative to the Cramer-Rao bound, and rates of found and false modes.
#include <cmath>
#include <numbers>
#include <random>

#include "tests/bench/rows.h"
#include "tests/solver/gaussian/simulated_pixel.h"

namespace glasswing {
namespace {

// The larger ratio of rms error to bound, of centre (x, y) and width (xx, yy), over all modes, if the right
// number of modes was found.
double over_bound(const Footprints& truth, double noise_sd) {
  constexpr int kTrials = 4000;
  const SampleLayout layout = four_sweeps(4.0);
  const std::vector<double> bound = cramer_rao_bound(truth, layout);
  std::mt19937 random(21);
  std::vector<double> squares(bound.size(), 0.0);
  int counted = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    JointFit fit = solved(recorded(truth, layout, noise_sd, random), noise_sd);
    if (fit.modes.size() != truth.size()) continue;
    ++counted;
    Footprints expected = truth;
    for (int m = 0; m < truth.size(); ++m) {
      // The error of the nearest mode that was found.
      int nearest = 0;
      for (int k = 1; k < fit.modes.size(); ++k) {
        const auto distance = [&](int i) {
          return std::hypot(fit.modes[i].x_px - truth[m].x_px, fit.modes[i].y_px - truth[m].y_px);
        };
        if (distance(k) < distance(nearest)) nearest = k;
      }
      for (int p = 0; p < 6; ++p) {
        squares[static_cast<size_t>(6 * m + p)] +=
            std::pow(parameter(fit.modes[nearest], p) - parameter(expected[m], p), 2);
      }
    }
  }
  double worst = 0.0;
  for (size_t p = 0; p < bound.size(); ++p) {
    if (p % 6 == 0 || p % 6 == 4) continue;
    worst = std::max(worst, std::sqrt(squares[p] / counted) / (noise_sd * bound[p]));
  }
  return worst;
}

// Share of pixels with at least `count` modes; two lie two response widths apart in any direction.
double share_with(int truth_count, int count) {
  constexpr int kTrials = 4000;
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(22);
  std::uniform_real_distribution<double> angle(0.0, 2.0 * std::numbers::pi), place(-1.0, 1.0);
  int found = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    Footprints truth;
    const double turn = angle(random),
                 apart = truth_count == 2 ? 2.0 * std::sqrt(16.0 + 4.0 + kFlatPixel_px2) : 0.0;
    for (int m = 0; m < truth_count; ++m) {
      const double side = m - 0.5 * (truth_count - 1);
      truth.push_back({.weight = 0.8 / truth_count,
                       .x_px = 60.0 + place(random) + side * apart * std::cos(turn),
                       .y_px = 48.0 + place(random) + side * apart * std::sin(turn),
                       .xx_px2 = 4.0,
                       .xy_px2 = 0.0,
                       .yy_px2 = 4.0});
    }
    found += solved(recorded(truth, layout, 0.01, random), 0.01).modes.size() >= count ? 1 : 0;
  }
  return 100.0 * found / kTrials;
}

}  // namespace

void add_accuracy_rows(std::vector<Row>& rows) {
  const Footprint one{.weight = 0.7, .x_px = 61.3, .y_px = 44.8, .xx_px2 = 6.0, .xy_px2 = 1.5, .yy_px2 = 4.0};
  Footprint other = one;
  // 3.2 response widths away: sigma_r is at most 4.8 px in these sweeps.
  other.weight = 0.5, other.x_px += 11.0, other.y_px += 11.0;
  rows.push_back(
      {"one mode, 0.5 % noise: error over the Cramer-Rao bound", "x", 1.05, true, {}, [=](const Rates&) {
         Footprints truth;
         truth.push_back(one);
         return over_bound(truth, 0.005);
       }});
  rows.push_back({"two modes 3.2 sigma apart, 0.5 % noise: error over the bound",
                  "x",
                  1.15,
                  true,
                  {},
                  [=](const Rates&) {
                    Footprints truth;
                    truth.push_back(one);
                    truth.push_back(other);
                    return over_bound(truth, 0.005);
                  }});
  rows.push_back(
      {"two modes 2 sigma apart, 1 % noise: both found", "% of pixels", 95.0, false, {}, [](const Rates&) {
         return share_with(2, 2);
       }});
  rows.push_back({"one mode, 1 % noise: a false second one", "% of pixels", 1.0, true, {}, [](const Rates&) {
                    return share_with(1, 2);
                  }});
}

}  // namespace glasswing
