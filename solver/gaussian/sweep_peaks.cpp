#include "solver/gaussian/sweep_peaks.h"

#include <ceres/tiny_solver.h>

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

struct GaussianResidual {
  using Scalar = double;
  enum { NUM_PARAMETERS = 3, NUM_RESIDUALS = Eigen::Dynamic };
  std::span<const double> r_px, y;

  int NumResiduals() const { return static_cast<int>(y.size()); }
  bool operator()(const double* p, double* residuals, double* jacobian) const {
    const auto n = static_cast<size_t>(NumResiduals());
    for (size_t i = 0; i < n; ++i) {
      const double z = (r_px[i] - p[1]) / p[2];
      const double g = std::exp(-0.5 * z * z);
      residuals[i] = p[0] * g - y[i];
      if (jacobian == nullptr) continue;
      jacobian[i] = g;
      jacobian[n + i] = p[0] * g * z / p[2];
      jacobian[2 * n + i] = p[0] * g * z * z / p[2];
    }
    return p[2] != 0.0;
  }
};

}  // namespace

std::vector<Peak> find_peaks(std::span<const double> r_px, std::span<const double> y, double floor,
                             int most) {
  const size_t n = y.size();
  std::vector<double> smooth(n);
  for (size_t i = 0; i < n; ++i) {
    smooth[i] = 0.25 * (y[i > 0 ? i - 1 : i] + 2.0 * y[i] + y[i + 1 < n ? i + 1 : i]);
  }
  std::vector<size_t> tops;
  for (size_t i = 0; i < n; ++i) {
    const bool rises = i == 0 || smooth[i] > smooth[i - 1];
    const bool falls = i + 1 == n || smooth[i] >= smooth[i + 1];
    if (rises && falls && smooth[i] > floor) tops.push_back(i);
  }
  std::sort(tops.begin(), tops.end(), [&](size_t a, size_t b) { return smooth[a] > smooth[b]; });
  if (tops.size() > static_cast<size_t>(most)) tops.resize(static_cast<size_t>(most));

  std::vector<Peak> peaks;
  for (const size_t top : tops) {
    // Down to a third of the crest, or to where it rises again.
    size_t first = top, last = top;
    while (first > 0 && smooth[first - 1] < smooth[first] && smooth[first] > 0.3 * smooth[top]) --first;
    while (last + 1 < n && smooth[last + 1] < smooth[last] && smooth[last] > 0.3 * smooth[top]) ++last;
    if (last - first < 2) {
      first = top > 1 ? top - 2 : 0;
      last = std::min(top + 2, n - 1);
    }
    const double reach_px = 0.5 * (r_px[last] - r_px[first]);
    const size_t count = last - first + 1;
    GaussianResidual residual{.r_px = r_px.subspan(first, count), .y = y.subspan(first, count)};
    ceres::TinySolver<GaussianResidual> solver;
    solver.options.max_num_iterations = 15;
    Eigen::Vector3d p(std::max(y[top], smooth[top]), r_px[top],
                      std::max(reach_px / 1.55, 0.5 * (r_px[1] - r_px[0])));
    const double start_sigma = p[2];
    solver.Solve(residual, &p);
    Peak peak{.amplitude = p[0], .centre_px = p[1], .sigma_px = std::abs(p[2])};
    const bool sane = std::isfinite(p[0]) && std::isfinite(p[1]) && peak.amplitude > 0.0 &&
                      std::abs(peak.centre_px - r_px[top]) < reach_px + start_sigma &&
                      peak.sigma_px < 5.0 * start_sigma;
    if (!sane) peak = {.amplitude = smooth[top], .centre_px = r_px[top], .sigma_px = start_sigma};
    peaks.push_back(peak);
  }
  return peaks;
}

double noise_of(std::span<const double> y) {
  if (y.size() < 5) return 0.0;
  std::vector<double> second;
  for (size_t i = 1; i + 1 < y.size(); ++i) second.push_back(std::abs(y[i - 1] - 2.0 * y[i] + y[i + 1]));
  const auto middle = second.begin() + static_cast<std::ptrdiff_t>(second.size() / 2);
  std::nth_element(second.begin(), middle, second.end());
  // sd of a second difference is sqrt(6) sd; the median of |normal| is 0.6745 sd.
  return *middle / (0.6745 * std::sqrt(6.0));
}

}  // namespace glasswing
