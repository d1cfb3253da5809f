#include "solver/fringe/fringe_unwrap.h"

#include <cmath>
#include <numbers>
#include <optional>

namespace glasswing {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

// An edge of bars that is nearer than this share of a period does not count on either side; nor does the
// distance from 1 or -1 of the response of a pixel that sees several places.
constexpr double kNearEdge = 0.06, kNearEdgeSd = 0.6, kAnswerSd = 0.2;
constexpr double kMostSurprise = 4.0;  // of a bar

// What an axis's bars and its other waves, down to half of this one's period, imply for a place: a
// chi-square.
double surprise_at(const WaveMonitor& monitor, const Spectrum& spectrum, size_t wave, size_t axis,
                   double at_px) {
  const auto frequency_of = [axis](const Wave& each) { return axis == 0 ? each.fx : each.fy; };
  const double period_px = 1.0 / std::abs(frequency_of(monitor.waves[wave]));
  double chi_square = 0.0;
  for (size_t i = 0; i < monitor.bars[axis].size(); ++i) {
    const BarAnswer& answer = spectrum.bars[axis][i];
    if (!std::isfinite(answer.sd)) continue;
    const double inside = monitor.bars[axis][i].inside_px(at_px) / (kNearEdge * period_px);
    const double sd = std::hypot(answer.sd, std::abs(inside) < 1.0 ? kNearEdgeSd : kAnswerSd);
    chi_square += std::pow((answer.value - std::clamp(inside, -1.0, 1.0)) / sd, 2);
  }
  for (size_t w = wave + 1; w < monitor.waves.size(); ++w) {
    const Wave& other = monitor.waves[w];
    const double f = frequency_of(other), size = std::abs(spectrum.phasors[w].value);
    if (f == 0.0 || (other.fx != 0.0 && other.fy != 0.0) || std::abs(f) * period_px > 2.0) continue;
    if (!(size > kWrongPeriod * spectrum.phasors[w].sd)) continue;
    const double miss_px = std::remainder(std::arg(spectrum.phasors[w].value) / kTurn - f * at_px, 1.0) / f;
    chi_square += std::pow(miss_px / (kNearEdge * period_px), 2);
  }
  return chi_square;
}

// The place on the monitor, of all that are whole periods apart, of the least chi-square, if the next one's
// is significantly greater. `margin_px`: how far beyond the monitor's edges it may lie.
struct Likeliest {
  std::optional<double> place_px;
  double chi_square = kUnknown;
};
template <typename ChiSquareAt>
Likeliest likeliest_place(double place_px, double period_px, double side_px, double margin_px,
                          const ChiSquareAt& chi_square_at) {
  Likeliest best;
  double next = kUnknown;
  const double first_px = place_px - period_px * std::floor((place_px + margin_px) / period_px);
  for (double at_px = first_px; at_px < side_px + margin_px; at_px += period_px) {
    const double chi_square = chi_square_at(at_px);
    next = std::min(next, std::max(chi_square, best.chi_square));
    if (chi_square < best.chi_square) best = {.place_px = at_px, .chi_square = chi_square};
  }
  if (next - best.chi_square > kWrongPeriod * kWrongPeriod) return best;
  return {};
}

// The place supported by bars and waves; none: not supported by one alone.
std::optional<double> settled_place(const WaveMonitor& monitor, const Spectrum& spectrum, size_t wave,
                                    size_t axis, double place_px) {
  const double period_px = 1.0 / std::abs(axis == 0 ? monitor.waves[wave].fx : monitor.waves[wave].fy);
  const double side_px = axis == 0 ? monitor.extent.width_px : monitor.extent.height_px;
  const Likeliest best =
      likeliest_place(place_px, period_px, side_px, kNearEdge * period_px,
                      [&](double at_px) { return surprise_at(monitor, spectrum, wave, axis, at_px); });
  // Bars that contradict one another determine no place.
  const double most = kMostSurprise * static_cast<double>(monitor.bars[axis].size());
  return best.chi_square < most ? best.place_px : std::nullopt;
}

// The phase of a wave, in turns.
struct Phase {
  double turns = 0.0, variance = 0.0;
  bool gaussian = false;  // noise will not turn its phasor right round
};

Phase phase_of(const Phasor& phasor, double tolerated) {
  const double sd = std::hypot(phasor.sd, tolerated), size = std::abs(phasor.value);
  return {.turns = std::arg(phasor.value) / kTurn,
          .variance = std::pow(sd / (kTurn * size), 2),
          .gaussian = size > kWrongPeriod * sd};
}

// What the finer waves along an axis, whose phases the pixel sees, imply for a place: a chi-square and its
// degrees of freedom. The place moves with the waves preceding each.
struct Beat {
  double chi_square = 0.0, degrees = 0.0;
};
Beat beat_at(const WaveMonitor& monitor, const Spectrum& spectrum, double tolerated, size_t wave, size_t axis,
             double at_px, double sd_px) {
  Beat beat;
  double variance_px2 = sd_px * sd_px;
  for (size_t w = wave + 1; w < monitor.waves.size(); ++w) {
    const Wave& other = monitor.waves[w];
    const double f = axis == 0 ? other.fx : other.fy;
    const Phase phase = phase_of(spectrum.phasors[w], tolerated);
    if (f == 0.0 || (other.fx != 0.0 && other.fy != 0.0) || !phase.gaussian) continue;
    const double variance = f * f * variance_px2 + phase.variance;
    if (kWrongPeriod * std::sqrt(variance) > 0.5) continue;
    const double miss = std::remainder(phase.turns - f * at_px, 1.0);
    beat.chi_square += miss * miss / variance;
    beat.degrees += 1.0;
    at_px += variance_px2 * f * miss / variance;
    variance_px2 *= phase.variance / variance;
  }
  return beat;
}

// Where the finer waves have the phases that the pixel sees (heterodyne: the beats of all waves are as long
// as the monitor); none: not of one alone.
std::optional<double> beaten_place(const WaveMonitor& monitor, const Spectrum& spectrum, double tolerated,
                                   size_t wave, size_t axis, double place_px, double sd_px) {
  const double period_px = 1.0 / std::abs(axis == 0 ? monitor.waves[wave].fx : monitor.waves[wave].fy);
  const double side_px = axis == 0 ? monitor.extent.width_px : monitor.extent.height_px;
  double degrees = 0.0;  // whether a wave counts does not hang on the place
  const Likeliest best =
      likeliest_place(place_px, period_px, side_px, kWrongPeriod * sd_px, [&](double at_px) {
        const Beat beat = beat_at(monitor, spectrum, tolerated, wave, axis, at_px, sd_px);
        degrees = beat.degrees;
        return beat.chi_square;
      });
  return best.chi_square < degrees + kWrongPeriod * kWrongPeriod ? best.place_px : std::nullopt;
}

}  // namespace

Unwrapped unwrap(const WaveMonitor& monitor, const Spectrum& spectrum, double tolerance) {
  Unwrapped place;
  place.used.assign(monitor.waves.size(), false);
  place.superseded.assign(monitor.waves.size(), false);
  double level = 0.0;
  for (const Phasor& phasor : spectrum.phasors) level = std::max(level, std::abs(phasor.value));
  std::array<bool, 2> known{};
  std::array<std::optional<size_t>, 2> coded;  // the wave that gives the place, where bars settle the period
  for (size_t w = 0; w < monitor.waves.size(); ++w) {
    const auto [cycles, phase_variance, gaussian] = phase_of(spectrum.phasors[w], tolerance * level);
    if (!gaussian) continue;
    const Eigen::Vector2d f(monitor.waves[w].fx, monitor.waves[w].fy);
    if (f.x() == 0.0 || f.y() == 0.0) {
      const size_t axis = f.x() != 0.0 ? 0 : 1;
      const auto at = static_cast<Eigen::Index>(axis);
      if (!known[axis]) {
        const double side_px = axis == 0 ? monitor.extent.width_px : monitor.extent.height_px;
        const double period_px = 1.0 / std::abs(f[at]), sd_px = std::sqrt(phase_variance) * period_px;
        // The candidate on the monitor or nearest to it.
        const double middle_px = 0.5 * side_px;
        double place_px = middle_px + std::remainder(cycles / f[at] - middle_px, period_px);
        // How far the second nearest lies outside.
        if (period_px - std::abs(place_px - middle_px) < middle_px + kWrongPeriod * sd_px) {
          const bool by_bars = !monitor.bars[axis].empty();
          const std::optional<double> settled =
              by_bars ? settled_place(monitor, spectrum, w, axis, place_px)
                      : beaten_place(monitor, spectrum, tolerance * level, w, axis, place_px, sd_px);
          if (!settled) continue;
          place_px = *settled;
          if (by_bars) coded[axis] = w;
        }
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
    const bool along_axis = f.x() == 0.0 || f.y() == 0.0;
    if (const size_t axis = f.x() != 0.0 ? 0 : 1; along_axis && coded[axis]) {
      const auto at = static_cast<Eigen::Index>(axis);
      place.disagreement_px = std::max(place.disagreement_px, std::abs(miss / f[at]));
      place.centre_px[at] += miss / f[at];
      place.covariance_px2(at, at) = phase_variance / (f[at] * f[at]);
      place.superseded[*coded[axis]] = true;
      coded[axis] = w;
      place.used[w] = true;
      continue;
    }
    place.centre_px += pull * (miss / variance);
    place.covariance_px2 -= pull * pull.transpose() / variance;
    place.used[w] = true;
  }
  place.found = known[0] && known[1];
  return place;
}

}  // namespace glasswing
