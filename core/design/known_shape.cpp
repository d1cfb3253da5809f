#include "core/design/known_shape.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

namespace glasswing {
namespace {

constexpr double kUseless = 1e4;  // times a wave's variance

int half_octaves(double value) {
  return static_cast<int>(std::lround(2.0 * std::log2(value)));
}
double of_half_octaves(int count) {
  return std::exp2(0.5 * count);
}

Frequency frequency_of(const DesignedWave& wave) {
  const ShownPattern pattern = wave_of(wave, 0.0);
  return {pattern.fx, pattern.fy};
}

// Of one sweep: where its stripes are.
void add_sweep(const StripeAxis& axis, std::vector<double> at_px, std::vector<SeenFrequency>& seen) {
  if (at_px.size() < 2) return;
  const auto [first, last] = std::ranges::minmax(at_px);
  const auto count = static_cast<double>(at_px.size());
  const double step_px = (last - first) / (count - 1.0), length_px = count * step_px;
  for (int k = 0; k <= static_cast<int>(0.5 * count); ++k) {
    const double f = k / length_px,
                 spectrum = axis.sigma_px * std::sqrt(2.0 * std::numbers::pi) *
                            std::exp(-2.0 * std::pow(std::numbers::pi * axis.sigma_px * f, 2)),
                 variance = 0.5 * length_px * step_px / (spectrum * spectrum);
    if (!(variance < kUseless * kWaveVariance)) break;
    seen.push_back({{f * axis.cos_phi, f * axis.sin_phi}, variance});
  }
}

}  // namespace

std::vector<SeenFrequency> seen_frequencies(std::span<const ShownPattern> patterns) {
  std::map<std::pair<double, double>, int> waves;
  std::map<std::tuple<double, double, double>, std::pair<StripeAxis, std::vector<double>>> sweeps;
  for (const ShownPattern& own : patterns) {
    if (own.kind == ShownPattern::Kind::kWave) ++waves[{own.fx, own.fy}];
    if (own.kind != ShownPattern::Kind::kStripe) continue;
    auto& [axis, at_px] = sweeps[{own.axis.cos_phi, own.axis.sin_phi, own.axis.sigma_px}];
    axis = own.axis;
    at_px.push_back(own.r_px);
  }
  std::vector<SeenFrequency> seen;
  for (const auto& [at, phases] : waves)
    seen.push_back({{at.first, at.second}, 2.0 * kWaveVariance / phases});
  for (auto& [key, sweep] : sweeps) add_sweep(sweep.first, std::move(sweep.second), seen);
  return seen;
}

ShapeKind shape_kind(const Footprints& modes, double noise_sd) {
  double light = 0.0, x_px = 0.0, y_px = 0.0, square_px2 = 0.0;
  for (const Footprint& mode : modes) {
    light += mode.weight;
    x_px += mode.weight * mode.x_px;
    y_px += mode.weight * mode.y_px;
  }
  x_px /= light, y_px /= light;
  for (const Footprint& mode : modes) {
    square_px2 += mode.weight / light *
                  (std::pow(mode.x_px - x_px, 2) + std::pow(mode.y_px - y_px, 2) + mode.xx_px2 + mode.yy_px2);
  }
  return {.extent = half_octaves(std::sqrt(0.5 * square_px2)),
          .light = half_octaves(light),
          .noise = half_octaves(noise_sd)};
}

KnownShape::KnownShape(const ShapeKind& kind, std::span<const SeenFrequency> seen,
                       std::span<const DesignedWave> waves)
    : count_(std::ssize(waves)),
      variance_(std::pow(of_half_octaves(kind.noise), 2)),
      each_(kContrast * kContrast / static_cast<double>(waves.size())) {
  std::vector<Frequency> frequencies;
  for (const DesignedWave& wave : waves) frequencies.push_back(frequency_of(wave));
  for (const SeenFrequency& own : seen) frequencies.push_back(own.at);
  const ShapePrior prior{.rho_px = of_half_octaves(kind.extent),
                         .lowest = std::pow(of_half_octaves(kind.light), 2)};
  for (const auto part : {ShapePosterior::Part::kReal, ShapePosterior::Part::kImaginary}) {
    ShapePosterior& own = parts_.emplace_back(frequencies, prior, part);
    for (Eigen::Index i = 0; i < std::ssize(seen); ++i)
      own.measure(count_ + i, static_cast<float>(seen[i].variance * variance_));
  }
}

double KnownShape::square() const {
  return each_ * (parts_[0].variance(count_) + parts_[1].variance(count_));
}

Eigen::ArrayXd KnownShape::lowered() const {
  const auto variance = static_cast<float>(kWaveVariance * variance_);
  const Eigen::ArrayXf gains = parts_[0].gains(count_, variance) + parts_[1].gains(count_, variance);
  return (square() - each_ * gains.cast<double>()).max(0.0);
}

void KnownShape::show(Eigen::Index wave) {
  for (ShapePosterior& own : parts_) own.measure(wave, static_cast<float>(kWaveVariance * variance_));
}

}  // namespace glasswing
