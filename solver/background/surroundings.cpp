#include "solver/background/surroundings.h"

#include <algorithm>
#include <cmath>

#include "solver/method/exposure_merge.h"

namespace glasswing {
namespace {

constexpr double kMinStep = 1.0 / 65535.0;
constexpr int kNeighbours = 4;   // each way along the row
constexpr double kAgrees = 5.0;  // standard deviations of one picture: beyond chance

}  // namespace

Surroundings::Surroundings(const FrameStack& stack, const StageLayout& layout, double tolerance)
    : stack_(stack),
      layout_(layout),
      noise_known_(layout.camera.read_sd() > 0.0),
      noise_(sample_noise(layout.camera, kUsualNoise)),
      silhouette_(tolerance) {
  for (const EmptyMonitor& monitor : layout.monitors)
    background_.emplace_back(monitor, noise_, stack.samples_per_pixel());
}

float Surroundings::black(int y, int lane) const {
  const size_t index = stack_.sample_index(0, y, 0) + static_cast<size_t>(lane);
  return static_cast<float>(merge(stack_, layout_.black, index, noise_).radiance);
}

bool Surroundings::has_object(int x, int y, double read_sd) {
  SampleNoise noise = noise_;
  noise.read_sd = read_sd;
  return changed_by_object(stack_, layout_, silhouette_, noise, x, y);
}

bool Surroundings::sees_patch(int x, int y) const {
  constexpr double kSure = 8.0;  // standard deviations, beyond any noise
  for (const std::vector<int>& frames : layout_.patches) {
    for (const int c : stack_.channels(x, y)) {
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

const SmoothStage* Surroundings::map_of(size_t monitor) const {
  if (stack_.stage_maps == nullptr || !stack_.stage_maps->of_monitor[monitor]) return nullptr;
  return &*stack_.stage_maps->of_monitor[monitor];
}

BackgroundPoint Surroundings::point_on_map(size_t monitor, int x, int y) {
  gather(stack_, layout_.monitors[monitor], x, y, empty_pixel_);
  const double x_px = x * stack_.column_step + 0.5, y_px = stack_.first_row + y + 0.5;
  const BackgroundMap& background = background_[monitor];
  return layout_.bare ? background.point_near(*map_of(monitor), empty_pixel_, x_px, y_px)
                      : background.point_on(*map_of(monitor), empty_pixel_, x_px, y_px);
}

// One pixel alone may be refuted by chance, or because it sees an edge of bars through a footprint of unusual
// shape.
void Surroundings::judge_maps(int y) {
  judged_row_ = y;
  on_map_.resize(background_.size());
  refuted_.resize(background_.size());
  const int width = stack_.width_px;
  for (size_t m = 0; m < background_.size(); ++m) {
    if (map_of(m) == nullptr) continue;
    std::vector<BackgroundPoint>& points = on_map_[m];
    points.clear();
    std::vector<bool> strained;
    for (int x = 0; x < width; ++x) {
      const BackgroundPoint& point = points.emplace_back(point_on_map(m, x, y));
      strained.push_back(point.seen && background_[m].refutes(point));
    }
    refuted_[m].assign(width, false);
    for (int x = 0; x < width; ++x) {
      if (!strained[x]) continue;
      int count = 0, against = 0;
      for (int i = std::max(x - kNeighbours, 0); i <= std::min(x + kNeighbours, width - 1); ++i) {
        count += points[i].seen;
        against += strained[i];
      }
      refuted_[m][x] = 2 * against > count;
    }
  }
}

std::span<const BackgroundPoint> Surroundings::background(int x, int y) {
  if (y != judged_row_) judge_maps(y);
  points_.clear();
  for (size_t m = 0; m < background_.size(); ++m) {
    if (map_of(m) != nullptr && !refuted_[m][x]) {
      points_.push_back(on_map_[m][x]);
      continue;
    }
    gather(stack_, layout_.monitors[m], x, y, empty_pixel_);
    const StraightView straight =
        straight_view(layout_.camera, layout_.monitors[m], x * stack_.column_step, stack_.first_row + y);
    points_.push_back(background_[m].point(empty_pixel_, straight));
  }
  return points_;
}

void Surroundings::set_foreground(int x, int y, const BackgroundPoint& point, Matte& matte) {
  for (const int c : stack_.channels(x, y)) {
    float& foreground = matte.foreground(x, y)[c];
    const double differs = point.foreground[c] - static_cast<double>(foreground),
                 variance = noise_.variance(static_cast<double>(foreground));
    const bool agrees = !point.ambiguous && differs * differs <= kAgrees * kAgrees * variance;
    if (layout_.black.empty() || agrees) foreground = static_cast<float>(point.foreground[c]);
  }
}

bool Surroundings::map_background(int x, int y, Matte& matte) {
  bool sure = true;
  std::array<size_t, kChannels> slot{};
  const std::span<const BackgroundPoint> points = background(x, y);
  for (size_t m = 0; m < points.size(); ++m) {
    const BackgroundPoint& point = points[m];
    if (!point.seen) continue;
    set_foreground(x, y, point, matte);
    if (point.ambiguous) matte.flags(x, y) |= kFlagPoorFit;
    sure = sure && !point.ambiguous;
    for (const int c : stack_.channels(x, y)) {
      size_t& place = slot[c];
      if (place == matte.modes(x, y, c).size()) continue;
      Mode& mode = matte.modes(x, y, c)[place++] = point.mode(c, layout_.monitors[m].texture);
      if (layout_.bare)
        mode.centre_sd_px = static_cast<float>(
            std::hypot(point.axis[0].centre_sd_px, point.axis[1].centre_sd_px) / std::sqrt(2.0));
    }
  }
  return sure;
}

SettledRow Surroundings::settle_row(int y, std::span<const double> read_sd, Matte& matte) {
  const size_t width = matte.width_px();
  SettledRow row{.object = std::vector<bool>(width), .open = std::vector<bool>(width)};
  for (int x = 0; x < matte.width_px(); ++x) {
    const size_t pixel = x;
    const bool patch = sees_patch(x, y);
    row.object[pixel] = !patch && has_object(x, y, read_sd.empty() ? noise_.read_sd : read_sd[pixel]);
    if (patch) {
      matte.flags(x, y) |= kFlagNoData;
      continue;
    }
    matte.coverage(x, y) = row.object[pixel] ? 1.0f : 0.0f;
    if (!layout_.black.empty()) {
      const auto row_start = static_cast<int>(stack_.sample_index(0, y, 0));
      for (const int c : stack_.channels(x, y))
        matte.foreground(x, y)[c] = black(y, static_cast<int>(stack_.sample_index(x, y, c)) - row_start);
    }
    row.open[pixel] = !row.object[pixel] && !map_background(x, y, matte);
  }
  return row;
}

}  // namespace glasswing
