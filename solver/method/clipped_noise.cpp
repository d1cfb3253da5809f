#include "solver/method/clipped_noise.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/footprint/normal_rectangle.h"

namespace glasswing {
namespace {

constexpr int kSteps = 1024;
constexpr float kMaxRatio = 4.0f;  // of g

// lambda(t) - t at equal steps of g.
std::array<float, kSteps + 1> make_table() {
  std::array<float, kSteps + 1> table{};
  double t = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double g = static_cast<double>(kMaxRatio) * i / kSteps;
    // g(t) >= t, and grows by Phi(t).
    for (int step = 0; step < 20; ++step)
      t = std::max(0.0, t - (t * normal_integral(t) + normal_density(t) - g) / normal_integral(t));
    table[i] = static_cast<float>(-mean_noise_below(t) - t);
  }
  return table;
}

}  // namespace

float expected_below_zero(float g) {
  static const std::array<float, kSteps + 1> table = make_table();
  const float place = std::clamp(g, 0.0f, kMaxRatio) * (kSteps / kMaxRatio);
  const auto before = std::min(static_cast<size_t>(place), static_cast<size_t>(kSteps - 1));
  const float part = place - static_cast<float>(before);
  return table[before] + part * (table[before + 1] - table[before]);
}

double mean_noise_below(double t) {
  // Far above 0 by the first terms of the asymptotic series.
  return t > 8.0 ? -(t + 1.0 / t) : -normal_density(t) / normal_integral(-t);
}

float sd_before_clipping(float zeros) {
  // max(0, n) has variance 1/2 - 1/(2 pi), and every second sample is 0.
  constexpr float kAtZero = 1.7126f;
  return 1.0f + (kAtZero - 1.0f) * std::min(2.0f * zeros, 1.0f);
}

}  // namespace glasswing
