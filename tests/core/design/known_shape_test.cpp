// What is known about footprints of any shape, against a brute-force sum: shapes as many independent normal
// numbers on a grid, and each image's sample by itself.
#include "core/design/known_shape.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "core/design/next_round.h"

namespace glasswing {
namespace {

using Complex = std::complex<double>;
constexpr double kPi = std::numbers::pi;
constexpr double kRho_px = 4.0, kLight = 0.5, kNoise_sd = 1.0 / 128.0;  // kinds are in half octaves
constexpr int kSide = 49;                                               // of the grid, 1 px apart
constexpr MonitorExtent kSeenExtent{.width_px = 128.0, .height_px = 96.0};

double root_spectrum(double f) {
  double sum = 0.0;
  for (int l = 0; l < 4; ++l)
    sum += std::pow(4.0, l) / 85.0 * std::exp(-std::pow(4.0, l + 1) * std::pow(kPi * f, 2));
  return std::sqrt(sum);
}

// What H at a frequency has of each of the grid's normal numbers.
Eigen::VectorXcd spectrum_at(double fx, double fy) {
  Eigen::VectorXcd row(kSide * kSide);
  for (int i = 0; i < kSide * kSide; ++i) {
    const double x = i % kSide - kSide / 2, y = static_cast<double>(i / kSide) - kSide / 2;
    const double window =
        std::exp(-0.5 * (x * x + y * y) / (kRho_px * kRho_px)) / (2.0 * kPi * kRho_px * kRho_px);
    row[i] = kLight * root_spectrum(std::hypot(fx, fy)) * std::sqrt(window) *
             std::polar(1.0, -2.0 * kPi * (fx * x + fy * y));
  }
  return row;
}

Eigen::VectorXd sample_of(const ShownPattern& pattern) {
  if (pattern.kind == ShownPattern::Kind::kWave)
    return 0.5 * (spectrum_at(pattern.fx, pattern.fy) * std::polar(1.0, pattern.phase_rad)).real();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(kSide * kSide);
  constexpr double kStep = 1.0 / 160.0;  // of frequency: longer than all that is seen
  const double sigma_px = pattern.axis.sigma_px;
  for (double f = -0.25; f <= 0.25; f += kStep) {
    const double stripe = sigma_px * std::sqrt(2.0 * kPi) * std::exp(-2.0 * std::pow(kPi * sigma_px * f, 2));
    sum += kStep * stripe *
           (spectrum_at(f * pattern.axis.cos_phi, f * pattern.axis.sin_phi) *
            std::polar(1.0, 2.0 * kPi * f * pattern.r_px))
               .real();
  }
  return sum;
}

double error_by_brute_force(const std::vector<ShownPattern>& patterns,
                            const std::vector<DesignedWave>& waves) {
  const Eigen::Index count = std::ssize(patterns);
  Eigen::MatrixXd samples(count, kSide * kSide);
  for (Eigen::Index i = 0; i < count; ++i) samples.row(i) = sample_of(patterns[i]);
  const Eigen::LLT<Eigen::MatrixXd> of_samples(
      samples * samples.transpose() + kNoise_sd * kNoise_sd * Eigen::MatrixXd::Identity(count, count));
  double sum = 0.0;
  for (const DesignedWave& wave : waves) {
    const ShownPattern at = wave_of(wave, 0.0);
    const Eigen::VectorXcd spectrum = spectrum_at(at.fx, at.fy);
    for (const Eigen::VectorXd& part : {Eigen::VectorXd(spectrum.real()), Eigen::VectorXd(spectrum.imag())}) {
      const Eigen::VectorXd shared = samples * part;
      sum += part.squaredNorm() - shared.dot(of_samples.solve(shared));
    }
  }
  return std::sqrt(kContrast * kContrast * sum / static_cast<double>(waves.size()));
}

ShapeKind kind() {
  Footprints modes;
  modes.push_back({.weight = kLight,
                   .x_px = 60.0,
                   .y_px = 40.0,
                   .xx_px2 = kRho_px * kRho_px,
                   .xy_px2 = 0.0,
                   .yy_px2 = kRho_px * kRho_px});
  return shape_kind(modes, kNoise_sd);
}

std::vector<ShownPattern> some_waves() {
  std::vector<ShownPattern> patterns;
  for (const double phi_deg : {0.0, 45.0, 90.0, 120.0}) {
    for (const double period_px : {90.0, 30.0, 17.0, 9.0}) add_phases({phi_deg, period_px}, patterns);
  }
  for (int k = 0; k < 3; ++k) patterns.push_back(wave_of({150.0, 12.0}, 2.0 * kPi * k / 3.0));
  return patterns;
}

// Sums in single precision.
constexpr double kRounding = 1e-3;

TEST(KnownShape, ErrorsAreThoseOfABruteForceSum) {
  const std::vector<DesignedWave> waves = usual_waves(kSeenExtent, true);
  for (const std::vector<ShownPattern>& patterns : {std::vector<ShownPattern>{}, some_waves()}) {
    const double error = error_by_brute_force(patterns, waves);
    EXPECT_NEAR(std::sqrt(KnownShape(kind(), seen_frequencies(patterns), waves).square()), error,
                kRounding * error);
  }
}

TEST(KnownShape, TellsWhatAWaveWouldLeave) {
  const std::vector<DesignedWave> waves = usual_waves(kSeenExtent, true);
  KnownShape known(kind(), seen_frequencies(some_waves()), waves);
  const Eigen::ArrayXd lowered = known.lowered();
  for (const size_t w : {size_t{7}, waves.size() / 3, waves.size() - 4}) {
    std::vector<ShownPattern> patterns = some_waves();
    add_phases(waves[w], patterns);
    const double error = error_by_brute_force(patterns, waves);
    EXPECT_NEAR(std::sqrt(lowered[static_cast<Eigen::Index>(w)]), error, kRounding * error) << w;
  }
  Eigen::Index best = 0;
  lowered.minCoeff(&best);
  known.show(best);
  EXPECT_NEAR(known.square(), lowered[best], kRounding * lowered[best]);
}

// A sweep's stripes stand for frequencies, which is exact for endless sweeps. What may differ is much less
// than what a kind's half octave of noise does.
TEST(KnownShape, SweepsTellAsMuchAsTheirStripes) {
  std::vector<ShownPattern> patterns;
  for (const double phi_deg : {0.0, 90.0, 45.0, -45.0}) {
    for (double r_px = -40.0; r_px <= 40.0; r_px += 3.0) {
      ShownPattern stripe;
      stripe.kind = ShownPattern::Kind::kStripe;
      stripe.axis = {.cos_phi = std::cos(phi_deg * kPi / 180.0),
                     .sin_phi = std::sin(phi_deg * kPi / 180.0),
                     .sigma_px = 3.0};
      stripe.r_px = r_px;
      patterns.push_back(stripe);
    }
  }
  const std::vector<DesignedWave> waves = usual_waves(kSeenExtent, true);
  const double error = error_by_brute_force(patterns, waves), none = error_by_brute_force({}, waves);
  EXPECT_LT(error, 0.8 * none);
  EXPECT_NEAR(std::sqrt(KnownShape(kind(), seen_frequencies(patterns), waves).square()), error, 0.05 * error);
}

}  // namespace
}  // namespace glasswing
