#include "solver/frames/beside_object.h"

#include <algorithm>
#include <cmath>

#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr double kMinBar_px = 4.0;        // a knock inverts finer ones
constexpr double kMinCorrelation = 0.98;  // of pixels that see the same thing
constexpr double kMinContrast = 20.0;     // standard deviations of noise
constexpr double kSameSlope = 0.04;
constexpr size_t kMinPairs = 3;

struct Line {
  double slope = 0.0, correlation = 0.0;
};

// Over all lanes of a pixel, each with its own mean.
Line line_of(const SessionSamples& samples, const std::vector<std::pair<size_t, size_t>>& pairs, size_t pixel,
             double noise_sd) {
  double xx = 0.0, xy = 0.0, yy = 0.0, count = 0.0;
  const size_t lanes = samples.lanes_per_pixel;
  for (size_t lane = pixel * lanes; lane < (pixel + 1) * lanes; ++lane) {
    double x = 0.0, y = 0.0, own = 0.0, own_xx = 0.0, own_xy = 0.0, own_yy = 0.0;
    for (const auto& [object, empty] : pairs) {
      const auto with = static_cast<double>(samples.light[object][lane]),
                 without = static_cast<double>(samples.light[empty][lane]);
      if (std::isnan(with + without)) continue;
      own += 1.0;
      x += without;
      y += with;
      own_xx += without * without;
      own_xy += without * with;
      own_yy += with * with;
    }
    if (own < static_cast<double>(kMinPairs)) continue;
    xx += own_xx - x * x / own;
    xy += own_xy - x * y / own;
    yy += own_yy - y * y / own;
    count += own;
  }
  if (count == 0.0 || !(xx > kMinContrast * kMinContrast * noise_sd * noise_sd)) return {};
  // Noise of both alone lowers the correlation.
  const double noise = count * noise_sd * noise_sd;
  return {.slope = xy / xx,
          .correlation = xy / std::sqrt(std::max(xx - noise, noise) * std::max(yy - noise, noise))};
}

// The middle of the narrowest part that holds half of the values, which ascend.
double mode_of(const std::vector<double>& values) {
  size_t first = 0, count = values.size();
  while (count > 2) {
    const size_t half = (count + 1) / 2;
    size_t best = first;
    for (size_t i = first; i + half <= first + count; ++i) {
      if (values[i + half - 1] - values[i] < values[best + half - 1] - values[best]) best = i;
    }
    first = best;
    count = half;
  }
  return values[first];
}

}  // namespace

std::vector<bool> beside_object(const SessionSamples& samples, const v1::CaptureManifest& manifest,
                                const StageLayout& layout, double noise_sd) {
  std::vector<bool> beside(samples.pixels.size(), layout.bare);
  if (layout.bare) return beside;
  std::vector<std::pair<size_t, size_t>> pairs;
  for (const StageLayout::Pair& pair : layout.pairs) {
    const auto object = static_cast<size_t>(pair.object.front().frame),
               empty = static_cast<size_t>(pair.empty.front().frame);
    const v1::Stimulus& stimulus = manifest.frames(static_cast<int>(object)).stimulus();
    const bool fine = kind_of(stimulus) == StimulusKind::kSquare && stimulus.bar_width_px() < kMinBar_px;
    if (!fine && !samples.light[object].empty() && !samples.light[empty].empty())
      pairs.emplace_back(object, empty);
  }
  if (pairs.size() < kMinPairs) return beside;
  std::vector<double> slopes;
  std::vector<Line> lines;
  for (size_t p = 0; p < samples.pixels.size(); ++p) {
    lines.push_back(line_of(samples, pairs, p, noise_sd));
    if (lines.back().correlation > kMinCorrelation) slopes.push_back(lines.back().slope);
  }
  if (slopes.empty()) return beside;
  std::ranges::sort(slopes);
  const double usual = mode_of(slopes);
  for (size_t p = 0; p < samples.pixels.size(); ++p) {
    beside[p] =
        lines[p].correlation > kMinCorrelation && std::abs(lines[p].slope - usual) < kSameSlope * usual;
  }
  return beside;
}

}  // namespace glasswing
