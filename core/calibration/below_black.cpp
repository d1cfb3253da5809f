#include "core/calibration/below_black.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr double kMinSamples = 20.0;  // beyond a knot, to determine it
constexpr double kMaxAtZero = 0.01;   // of the samples, at code 0

// The distribution of codes, each spread evenly over its step: the end of each step, as a share of full
// scale, and the share of samples below it.
struct Distribution {
  std::vector<double> code, below;
  double all = 0.0;

  explicit Distribution(const std::vector<size_t>& count) {
    std::vector<size_t> seen;
    for (size_t sample = 0; sample < count.size(); ++sample) {
      if (count[sample] > 0) seen.push_back(sample);
      all += static_cast<double>(count[sample]);
    }
    double sum = 0.0;
    for (size_t i = 0; i < seen.size(); ++i) {
      const auto here = static_cast<double>(seen[i]);
      const double after = i + 1 < seen.size() ? static_cast<double>(seen[i + 1]) : here + 1.0;
      if (i == 0) {
        code.push_back((here - 0.5 * (after - here)) / 65535.0);
        below.push_back(0.0);
      }
      sum += static_cast<double>(count[seen[i]]);
      code.push_back(0.5 * (here + after) / 65535.0);
      below.push_back(sum / all);
    }
  }
};

// Interpolates y at x linearly between points with rising `xs`.
double along(const std::vector<double>& xs, const std::vector<double>& ys, double x) {
  const auto after = std::lower_bound(xs.begin(), xs.end(), x);
  if (after == xs.begin()) return ys.front();
  if (after == xs.end()) return ys.back();
  const size_t i = after - xs.begin();
  const double part = (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
  return ys[i - 1] + part * (ys[i] - ys[i - 1]);
}

double light_at(const v1::CameraCurve& curve, double code) {
  const double at = code * (curve.light_size() - 1);
  const int before = std::clamp(static_cast<int>(at), 0, curve.light_size() - 2);
  const double part = at - before;
  return (1.0 - part) * curve.light(before) + part * curve.light(before + 1);
}

}  // namespace

void continue_below_black(const std::vector<size_t>& count, v1::CameraCurve& curve) {
  const Distribution black(count);
  if (black.all < 2.0 * kMinSamples || static_cast<double>(count[0]) > kMaxAtZero * black.all) return;
  const double last = curve.light_size() - 1.0;
  const int first_above = static_cast<int>(std::floor(curve.black_level() * last)) + 1;
  // Light just above black depends on the knot below black, which is not known yet, so a line stands in for
  // it.
  const double above = curve.light(first_above);
  const double slope = above / (first_above / last - curve.black_level());
  const auto light_above = [&](double code) {
    return code < first_above / last ? slope * (code - curve.black_level()) : light_at(curve, code);
  };
  double fall = slope / last;  // from a knot to the next lower one
  for (int k = first_above - 1; k >= 0; --k) {
    const double share = along(black.code, black.below, k / last);
    double light = curve.light(k + 1) - fall;
    if (share * black.all >= kMinSamples && share < 0.5) {
      const double mirrored = -light_above(along(black.below, black.code, 1.0 - share));
      // Noise of the counts must not make the curve fall.
      if (mirrored < curve.light(k + 1) - 0.1 * fall) light = mirrored;
    }
    fall = std::min(fall, curve.light(k + 1) - light);
    curve.set_light(k, static_cast<float>(light));
  }
}

}  // namespace glasswing
