#include "solver/ramp/smoother/ramp_smoother_motion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/for_rows.h"

namespace glasswing {
namespace {

constexpr int kRim_px = 8;   // compared around each block
constexpr int kAcross = 8;   // pixels compared across block and rim; enough for smooth pilots
constexpr int kPace_px = 4;  // step of the first search
constexpr int kPaces = 4;
constexpr float kExpected = 3.0f, kGain = 0.5f;
constexpr float kMax = 32.0f;
constexpr int kMean_px = 4;  // half the side of the square of which m is the mean

struct Step {
  int x = 0, y = 0;
};

// chi^2 between pixel `own` of one frame and `there` of the other, at most kMax.
struct Difference {
  const SmoothState& one;
  const SmoothState& other;
  float rho_info;

  float operator()(size_t own, size_t there) const {
    const float right = other.value[0][there] - one.value[0][own];
    const float down = other.value[1][there] - one.value[1][own];
    const float darker = other.value[2][there] - one.value[2][own];
    const float s = (right * right + down * down) * both(one.info[own], other.info[there]) +
                    darker * darker * rho_info * both(one.count[own], other.count[there]);
    return s < kMax ? s : kMax;
  }

 private:
  static float both(float a, float b) { return a * b / (a + b + 1e-30f); }
};

// Another frame and the motion of this frame's blocks to it.
class Joiner {
 public:
  Joiner(const SmoothPilot& pilot, const SmoothPilot& other, int thread_count)
      : pilot_(pilot),
        other_(other),
        offset_{.x = pilot.area.x0 - other.area.x0, .y = pilot.area.y0 - other.area.y0},
        difference_{
            .one = pilot.state, .other = other.state, .rho_info = std::min(pilot.rho_info, other.rho_info)},
        thread_count_(thread_count),
        block_px_(std::min(pilot.area.width, pilot.area.height) < 256 ? 16 : 32),
        across_((pilot.area.width + block_px_ - 1) / block_px_) {
    const int down = (pilot.area.height + block_px_ - 1) / block_px_;
    steps_.resize(static_cast<size_t>(across_) * down);
    for_rows(down, thread_count, [&](int first, int last) {
      for (int j = first; j < last; ++j) {
        for (int i = 0; i < across_; ++i) steps_[j * across_ + i] = search(i * block_px_, j * block_px_);
      }
    });
  }

  // Adds weights and weighted samples to `sums` and `rho_weight`.
  void add_to(SmoothSamples& sums, Plane& rho_weight) const {
    const SmoothArea& area = pilot_.area;
    Plane difference(area.size()), found(area.size()), summed(area.size()), counted(area.size());
    for_rows(area.height, thread_count_, [&](int first, int last) {
      for (int y = first; y < last; ++y) {
        each_run(y, [&](size_t own, size_t there, size_t count) {
          for (size_t i = 0; i < count; ++i)
            found[own + i] = pilot_.samples.object[own + i] * other_.samples.object[there + i];
          for (size_t i = 0; i < count; ++i)
            difference[own + i] = found[own + i] * difference_(own + i, there + i);
        });
        sum_along_row(y, difference, summed);
        sum_along_row(y, found, counted);
      }
    });
    for_rows(area.height, thread_count_, [&](int first, int last) {
      std::vector<float> mean(area.stride());
      for (int y = first; y < last; ++y) {
        const size_t row = area.at(0, y);
        mean_of_rows(row, summed, counted, mean);
        each_run(y, [&](size_t own, size_t there, size_t count) {
          const SmoothSamples& samples = other_.samples;
          for (size_t i = own, j = there; i < own + count; ++i, ++j) {
            const float agreement =
                found[i] * clamp(2.0f - difference[i] / 6.0f) * clamp(2.0f - mean[i - row] / kExpected);
            const float weight = agreement * samples.info[j];
            const float rho = samples.info[j] > 0.0f ? agreement : 0.0f;
            sums.info[i] += weight;
            rho_weight[i] += rho;
            sums.value[0][i] += weight * samples.value[0][j];
            sums.value[1][i] += weight * samples.value[1][j];
            sums.value[2][i] += rho * samples.value[2][j];
          }
        });
      }
    });
  }

 private:
  static float clamp(float value) { return value < 0.0f ? 0.0f : value > 1.0f ? 1.0f : value; }

  Step search(int x0, int y0) const {
    Step best;
    const std::vector<Place> places = places_of(x0, y0);
    if (places.empty()) return best;
    const auto count = static_cast<float>(places.size());
    float least = cost(places, best, kMax * count);
    if (least <= kExpected * count) return best;
    const auto look_around = [&](Step centre, int pace, int rings) {
      for (int ring = 1; ring <= rings; ++ring) {
        for (int v = -ring; v <= ring; ++v) {
          for (int u = -ring; u <= ring; ++u) {
            if (std::max(std::abs(u), std::abs(v)) != ring) continue;
            const Step step{.x = centre.x + u * pace, .y = centre.y + v * pace};
            const float most = least - kGain * count;
            if (const float own = cost(places, step, most); own < most) {
              least = own;
              best = step;
            }
          }
        }
      }
    };
    look_around({}, kPace_px, kPaces);
    for (int pace = kPace_px / 2; pace > 0; pace /= 2) look_around(best, pace, 1);
    return best;
  }

  // A pixel of this frame and its index in the other without motion.
  struct Place {
    size_t own = 0;
    int x = 0, y = 0;
  };

  // Some pixels on the object of a block and its rim.
  std::vector<Place> places_of(int x0, int y0) const {
    const SmoothArea& area = pilot_.area;
    const int every = (block_px_ + 2 * kRim_px) / kAcross;
    const int right = std::min(x0 + block_px_ + kRim_px, area.width);
    const int bottom = std::min(y0 + block_px_ + kRim_px, area.height);
    std::vector<Place> places;
    for (int y = std::max(y0 - kRim_px, 0); y < bottom; y += every) {
      for (int x = std::max(x0 - kRim_px, 0); x < right; x += every) {
        const size_t own = area.at(x, y);
        if (pilot_.samples.object[own] > 0.0f)
          places.push_back({.own = own, .x = x + offset_.x, .y = y + offset_.y});
      }
    }
    return places;
  }

  // The sum over these pixels; stops early once it reaches `most`.
  float cost(const std::vector<Place>& places, Step step, float most) const {
    const SmoothArea& beyond = other_.area;
    float sum = 0.0f;
    for (const Place& place : places) {
      const int column = place.x + step.x, row = place.y + step.y;
      const bool inside = column >= 0 && row >= 0 && column < beyond.width && row < beyond.height;
      const size_t there = inside ? beyond.at(column, row) : 0;
      sum += inside && other_.samples.object[there] > 0.0f ? difference_(place.own, there) : kMax;
      if (sum >= most) break;
    }
    return sum;
  }

  // Calls use(own, there, count) for runs of pixels of a row with the same motion, within both areas.
  template <typename Use>
  void each_run(int y, const Use& use) const {
    for (int i = 0; i < across_; ++i) {
      const Step& step = steps_[(y / block_px_) * across_ + i];
      const int row = y + offset_.y + step.y, moved = offset_.x + step.x;
      if (row < 0 || row >= other_.area.height) continue;
      const int first = std::max(i * block_px_, -moved);
      const int last = std::min({(i + 1) * block_px_, pilot_.area.width, other_.area.width - moved});
      if (first >= last) continue;
      use(pilot_.area.at(first, y), other_.area.at(first + moved, row), static_cast<size_t>(last - first));
    }
  }

  // Mean over 2 kMean_px + 1 pixels.
  void sum_along_row(int y, const Plane& from, Plane& to) const {
    const float* const row = &from[pilot_.area.at(0, y)];
    float* const out = &to[pilot_.area.at(0, y)];
    for (int x = 0; x < pilot_.area.width; ++x) {
      float sum = 0.0f;
      for (int u = -kMean_px; u <= kMean_px; ++u) sum += row[x + u];
      out[x] = sum;
    }
  }

  void mean_of_rows(size_t row, const Plane& summed, const Plane& counted, std::vector<float>& mean) const {
    const size_t stride = pilot_.area.stride(), above = row - kMean_px * stride;
    for (size_t x = 0; x < static_cast<size_t>(pilot_.area.width); ++x) {
      float sum = 0.0f, count = 1e-30f;
      for (size_t v = 0; v <= 2 * kMean_px; ++v) {
        sum += summed[above + v * stride + x];
        count += counted[above + v * stride + x];
      }
      mean[x] = sum / count;
    }
  }

  const SmoothPilot& pilot_;
  const SmoothPilot& other_;
  const Step offset_;
  const Difference difference_;
  const int thread_count_, block_px_, across_;
  std::vector<Step> steps_;
};

}  // namespace

SmoothSamples join_along_motion(const SmoothPilot& pilot, std::span<const SmoothPilot* const> others,
                                int thread_count) {
  SmoothSamples joined = pilot.samples;
  if (others.empty()) return joined;
  const size_t size = pilot.area.size();
  Plane rho_weight(size);
  for (size_t i = 0; i < size; ++i) {
    for (size_t k = 0; k < 2; ++k) joined.value[k][i] *= joined.info[i];
    // Without information about c, rho is not reliable either.
    rho_weight[i] = joined.info[i] > 0.0f ? 1.0f : 0.0f;
    joined.value[2][i] *= rho_weight[i];
  }
  for (const SmoothPilot* other : others) Joiner(pilot, *other, thread_count).add_to(joined, rho_weight);
  for (size_t i = 0; i < size; ++i) {
    if (joined.info[i] <= 0.0f) continue;
    for (size_t k = 0; k < 2; ++k) joined.value[k][i] /= joined.info[i];
    joined.value[2][i] /= rho_weight[i];
  }
  return joined;
}

}  // namespace glasswing
