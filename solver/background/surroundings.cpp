#include "solver/background/surroundings.h"

#include <algorithm>
#include <cmath>

#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr double kMinStep = 1.0 / 65535.0;
constexpr double kUsualNoise = 0.003;

}  // namespace

Surroundings::Surroundings(const FrameStack& stack, const StageLayout& layout, double tolerance)
    : stack_(stack),
      layout_(layout),
      camera_(layout.camera),
      noise_known_(camera_.read_sd() > 0.0),
      noise_(sample_noise(camera_, kUsualNoise)),
      silhouette_(tolerance) {
  camera_.set_width_px(stack.width_px);
  for (const EmptyMonitor& monitor : layout.monitors) background_.emplace_back(monitor, noise_);
}

float Surroundings::black(int y, int lane) const {
  const size_t index = stack_.sample_index(0, y, 0) + static_cast<size_t>(lane);
  return static_cast<float>(merge(stack_, layout_.black, index, noise_).radiance);
}

bool Surroundings::has_object(int x, int y, double read_sd) {
  SampleNoise noise = noise_;
  noise.read_sd = read_sd;
  pairs_.clear();
  for (const StageLayout::Pair& pair : layout_.pairs) {
    for (int c = 0; c < kChannels; ++c) {
      const size_t index = stack_.sample_index(x, y, c);
      const MergedSample object = merge(stack_, pair.object, index, noise);
      const MergedSample empty = merge(stack_, pair.empty, index, noise);
      pairs_.push_back({.object = object.radiance,
                        .empty = empty.radiance,
                        .variance = object.variance + empty.variance,
                        .saturated = object.saturated && empty.saturated});
    }
  }
  return silhouette_.test(pairs_).object;
}

bool Surroundings::sees_patch(int x, int y) const {
  constexpr double kSure = 8.0;  // standard deviations, beyond any noise
  for (const std::vector<int>& frames : layout_.patches) {
    for (int c = 0; c < kChannels; ++c) {
      float low = INFINITY, high = -INFINITY;
      for (const int frame : frames) {
        const float sample = stack_.at(frame, x, y, c);
        low = std::min(low, sample);
        high = std::max(high, sample);
      }
      const double sd = std::sqrt(noise_.variance(static_cast<double>(high)));
      if (static_cast<double>(high - low) > kSure * std::max(sd, kMinStep)) return true;
    }
  }
  return false;
}

std::span<const BackgroundPoint> Surroundings::background(int x, int y) {
  points_.clear();
  for (size_t m = 0; m < background_.size(); ++m) {
    gather(stack_, layout_.monitors[m], x, y, empty_pixel_);
    const StraightView straight = straight_view(camera_, layout_.monitors[m], x, stack_.first_row + y);
    points_.push_back(background_[m].point(empty_pixel_, straight));
  }
  return points_;
}

bool Surroundings::map_background(int x, int y, Matte& matte) {
  bool sure = true;
  std::array<size_t, kChannels> slot{};
  const std::span<const BackgroundPoint> points = background(x, y);
  for (size_t m = 0; m < points.size(); ++m) {
    const BackgroundPoint& point = points[m];
    if (!point.seen) continue;
    for (size_t c = 0; c < kChannels && layout_.black.empty(); ++c)
      matte.foreground(x, y)[c] = static_cast<float>(point.foreground[c]);
    if (point.ambiguous) matte.flags(x, y) |= kFlagPoorFit;
    sure = sure && !point.ambiguous;
    for (int c = 0; c < kChannels; ++c) {
      size_t& place = slot[static_cast<size_t>(c)];
      if (place < matte.modes(x, y, c).size())
        matte.modes(x, y, c)[place++] = point.mode(c, layout_.monitors[m].texture);
    }
  }
  return sure;
}

SettledRow Surroundings::settle_row(int y, std::span<const double> read_sd, Matte& matte) {
  const auto width = static_cast<size_t>(matte.width_px());
  SettledRow row{.object = std::vector<bool>(width), .open = std::vector<bool>(width)};
  for (int x = 0; x < matte.width_px(); ++x) {
    const auto pixel = static_cast<size_t>(x);
    const bool patch = sees_patch(x, y);
    row.object[pixel] = !patch && has_object(x, y, read_sd.empty() ? noise_.read_sd : read_sd[pixel]);
    if (patch) {
      matte.flags(x, y) |= kFlagNoData;
      continue;
    }
    matte.coverage(x, y) = row.object[pixel] ? 1.0f : 0.0f;
    for (int c = 0; c < kChannels && !layout_.black.empty(); ++c)
      matte.foreground(x, y)[static_cast<size_t>(c)] = black(y, x * kChannels + c);
    row.open[pixel] = !row.object[pixel] && !map_background(x, y, matte);
  }
  return row;
}

}  // namespace glasswing
