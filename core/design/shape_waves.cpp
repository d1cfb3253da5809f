#include "core/design/shape_waves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "core/design/shape_posterior.h"

namespace glasswing {
namespace {

constexpr int kTurns = 32, kSteps = 40;
constexpr double kPi = std::numbers::pi;
constexpr double kUsualSide_px = 128.0;
constexpr std::array<double, 2> kRadius_px{4.5, 9.0};  // rho, on a monitor of the usual side
constexpr double kLowest = 0.3;                        // E |H|^2 of the lowest frequencies
constexpr int kPlaceWaves = 12;                        // of the coarse ladder, which
constexpr double kPlace_px = 20.0;                     // ends at this period, on a monitor of the usual side
constexpr double kLongest = 1.5;                       // of a shape's period, over the monitor's longer side

}  // namespace

std::vector<DesignedWave> shape_waves(const MonitorExtent& extent, int count, double finest_px,
                                      const CameraNoise& noise) {
  const double side_px = std::max(extent.width_px, extent.height_px),
               unit_px = std::sqrt(side_px / kUsualSide_px);
  std::vector<Frequency> frequencies;
  std::vector<DesignedWave> grid;
  const double longest_px = kLongest * side_px;
  for (int a = 0; a < kTurns; ++a) {
    const double phi_deg = -90.0 + 180.0 * (a + 1) / kTurns, phi_rad = phi_deg * kPi / 180.0;
    for (int r = 0; r < kSteps; ++r) {
      const double period_px =
          std::round(100.0 * longest_px *
                     std::pow(finest_px / longest_px, static_cast<double>(r) / (kSteps - 1))) /
          100.0;
      frequencies.push_back({std::cos(phi_rad) / period_px, std::sin(phi_rad) / period_px});
      grid.push_back({.phi_deg = phi_deg, .period_px = period_px});
    }
  }
  std::vector<ShapePosterior> posteriors;
  for (const double rho_px : kRadius_px) {
    for (const auto part : {ShapePosterior::Part::kReal, ShapePosterior::Part::kImaginary})
      posteriors.emplace_back(frequencies, ShapePrior{.rho_px = rho_px * unit_px, .lowest = kLowest}, part);
  }
  const auto variance = static_cast<float>(kWaveVariance * noise.variance(0.5));
  constexpr std::array<double, 4> kAlong{0.0, 90.0, 45.0, -45.0};
  std::vector<DesignedWave> waves =
      wave_ladder(extent, kAlong, std::min(kPlaceWaves, count), kPlace_px * unit_px);
  const auto measure = [&](Eigen::Index i) {
    for (ShapePosterior& own : posteriors) own.measure(i, variance);
  };
  for (const DesignedWave& wave : waves) {
    const double phi_rad = wave.phi_deg * kPi / 180.0, x = std::cos(phi_rad) / wave.period_px,
                 y = std::sin(phi_rad) / wave.period_px;
    const auto nearest = std::ranges::min_element(frequencies, {}, [&](const Frequency& f) {
      return std::min(std::hypot(f.x - x, f.y - y), std::hypot(f.x + x, f.y + y));
    });
    measure(nearest - frequencies.begin());
  }
  std::set<Eigen::Index> taken;
  while (std::ssize(waves) < count) {
    Eigen::ArrayXf gains = Eigen::ArrayXf::Zero(std::ssize(frequencies));
    for (const ShapePosterior& own : posteriors) gains += own.gains(std::ssize(frequencies), variance);
    for (const Eigen::Index i : taken) gains[i] = 0.0f;
    Eigen::Index best = 0;
    gains.maxCoeff(&best);
    taken.insert(best);
    measure(best);
    waves.push_back(grid[best]);
  }
  std::ranges::sort(waves, [](const DesignedWave& a, const DesignedWave& b) {
    return a.phi_deg != b.phi_deg ? a.phi_deg < b.phi_deg : a.period_px > b.period_px;
  });
  // A ladder's wave may be one of the grid's.
  waves.erase(std::unique(waves.begin(), waves.end(),
                          [](const DesignedWave& a, const DesignedWave& b) {
                            return a.phi_deg == b.phi_deg && a.period_px == b.period_px;
                          }),
              waves.end());
  return waves;
}

}  // namespace glasswing
