#include "camera-node/services/focus.h"

#include <algorithm>
#include <array>

namespace glasswing {
namespace {

// Of D(1), which is mostly noise where there are no edges. A frame of 128 x 96 px of noise alone stays below
// a quarter of this with five standard deviations.
constexpr double kMinContrast = 0.1;
constexpr double kDark = 0.01 * 65535.0;
constexpr double kMinRuns = 0.2;  // of all runs; the others are clipped

// D(1), D(2) and D(4), all over the same runs of five pixels.
class Structure {
 public:
  explicit Structure(std::uint16_t full_scale) : full_scale_(full_scale) {}

  void add(const std::array<std::uint16_t, 5>& run) {
    ++runs_;
    if (std::ranges::any_of(run, [this](std::uint16_t sample) { return sample >= full_scale_; })) return;
    ++counted_;
    for (size_t i = 0; i < kDistances.size(); ++i) {
      const double difference = static_cast<double>(run[0]) - static_cast<double>(run[kDistances[i]]);
      sums_[i] += difference * difference;
    }
  }

  bool enough() const { return static_cast<double>(counted_) >= kMinRuns * static_cast<double>(runs_); }
  double at_1() const { return mean(0); }
  double at_2() const { return mean(1); }
  double at_4() const { return mean(2); }

 private:
  static constexpr std::array<size_t, 3> kDistances{1, 2, 4};
  double mean(size_t i) const { return counted_ == 0 ? 0.0 : sums_[i] / static_cast<double>(counted_); }

  const std::uint16_t full_scale_;
  std::array<double, kDistances.size()> sums_{};
  std::int64_t counted_ = 0, runs_ = 0;
};

Structure structure_of(const Image16& image, std::uint16_t full_scale) {
  constexpr int kReach = 4;
  Structure structure(full_scale);
  const auto run = [&](int x, int y, int dx, int dy) {
    std::array<std::uint16_t, kReach + 1> samples;
    for (int i = 0; i <= kReach; ++i) samples[i] = image.at(x + i * dx, y + i * dy, 1);
    structure.add(samples);
  };
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      if (x + kReach < image.width_px) run(x, y, 1, 0);
      if (y + kReach < image.height_px) run(x, y, 0, 1);
    }
  }
  return structure;
}

double mean_green(const Image16& image) {
  double sum = 0.0;
  for (size_t i = 1; i < image.samples.size(); i += 3) sum += image.samples[i];
  return image.samples.empty() ? 0.0 : sum / (static_cast<double>(image.samples.size()) / 3.0);
}

}  // namespace

Focus focus_of(const Image16& image, std::uint16_t full_scale) {
  const Structure structure = structure_of(image, full_scale);
  if (!structure.enough())
    return {.hint = "too bright to judge focus: shorten the exposure or close the aperture"};
  const double coarse = structure.at_4() - structure.at_2();
  if (coarse > kMinContrast * structure.at_1()) {
    const double ratio = (structure.at_2() - structure.at_1()) / coarse;
    return {.value = std::clamp(4.0 * ratio - 1.0, 0.0, 1.0), .hint = {}};
  }
  if (mean_green(image) < kDark)
    return {.hint =
                "too dark to judge focus: show a test chart (glasswing preview --pattern lines), or expose "
                "longer"};
  return {.hint = "no edges to judge focus by: show a test chart (glasswing preview --pattern lines)"};
}

}  // namespace glasswing
