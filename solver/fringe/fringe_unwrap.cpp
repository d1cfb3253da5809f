#include "solver/fringe/fringe_unwrap.h"

#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

}  // namespace

Unwrapped unwrap(const WaveMonitor& monitor, const Spectrum& spectrum, double tolerance) {
  Unwrapped place;
  place.used.assign(monitor.waves.size(), false);
  double level = 0.0;
  for (const Phasor& phasor : spectrum.phasors) level = std::max(level, std::abs(phasor.value));
  std::array<bool, 2> known{};
  for (size_t w = 0; w < monitor.waves.size(); ++w) {
    const Phasor& phasor = spectrum.phasors[w];
    const double sd = std::hypot(phasor.sd, tolerance * level), size = std::abs(phasor.value);
    // If noise may turn a phasor right round, its phase is not Gaussian.
    if (!(size > kWrongPeriod * sd)) continue;
    const double phase_variance = std::pow(sd / (kTurn * size), 2);
    const double cycles = std::arg(phasor.value) / kTurn;
    const Eigen::Vector2d f(monitor.waves[w].fx, monitor.waves[w].fy);
    if (f.x() == 0.0 || f.y() == 0.0) {
      const size_t axis = f.x() != 0.0 ? 0 : 1;
      const auto at = static_cast<Eigen::Index>(axis);
      if (!known[axis]) {
        const double side_px = axis == 0 ? monitor.extent.width_px : monitor.extent.height_px;
        const double period_px = 1.0 / std::abs(f[at]), sd_px = std::sqrt(phase_variance) * period_px;
        // The candidate on the monitor or nearest to it.
        const double middle_px = 0.5 * side_px;
        const double place_px = middle_px + std::remainder(cycles / f[at] - middle_px, period_px);
        // How far the second nearest lies outside.
        if (period_px - std::abs(place_px - middle_px) < middle_px + kWrongPeriod * sd_px) continue;
        known[axis] = true;
        place.centre_px[at] = place_px;
        place.covariance_px2(at, at) = sd_px * sd_px;
        place.used[w] = true;
        continue;
      }
    } else if (!known[0] || !known[1]) {
      continue;
    }
    const Eigen::Vector2d pull = place.covariance_px2 * f;
    const double variance = f.dot(pull) + phase_variance;
    if (kWrongPeriod * std::sqrt(variance) > 0.5) continue;
    const double miss = std::remainder(cycles - f.dot(place.centre_px), 1.0);
    place.centre_px += pull * (miss / variance);
    place.covariance_px2 -= pull * pull.transpose() / variance;
    place.used[w] = true;
  }
  place.found = known[0] && known[1];
  return place;
}

}  // namespace glasswing
