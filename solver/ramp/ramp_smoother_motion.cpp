#include "solver/ramp/ramp_smoother_motion.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "solver/ramp/for_rows.h"

namespace glasswing {
namespace {

constexpr int kBlock_px = 16;  // side of what moves as one
constexpr int kRim_px = 8;     // a block's neighbourhood that is compared with it
constexpr int kEvery_px = 4;   // pilots are smooth: every fourth pixel tells
constexpr int kLongest_px = 16;
constexpr float kGain = 0.5f;
constexpr float kMost = 32.0f;
constexpr int kMean_px = 4;  // half the side of the square of which m is the mean

struct Step {
  int x = 0, y = 0;
};

class Matcher {
 public:
  Matcher(const SmoothPilot& pilot, const SmoothPilot& other)
      : pilot_(pilot),
        other_(other),
        offset_{.x = pilot.area.x0 - other.area.x0, .y = pilot.area.y0 - other.area.y0} {}

  // Where pixel (x, y) of the pilot's area lies in the other's, moved; false: beyond it.
  bool place(int x, int y, Step step, size_t& at) const {
    const int column = x + offset_.x + step.x, row = y + offset_.y + step.y;
    if (column < 0 || row < 0 || column >= other_.area.width || row >= other_.area.height) return false;
    at = other_.area.at(column, row);
    return other_.samples.object[at] > 0.0f;
  }

  float difference(size_t own, size_t there) const {
    const SmoothState &a = pilot_.state, &b = other_.state;
    float squares[3];
    for (size_t k = 0; k < 3; ++k) {
      const float off = b.value[k][there] - a.value[k][own];
      squares[k] = off * off;
    }
    const auto harmonic = [](float one, float two) { return one > 0.0f ? one * two / (one + two) : 0.0f; };
    const float rho_info = std::min(pilot_.rho_info, other_.rho_info);
    const float s = (squares[0] + squares[1]) * harmonic(a.info[own], b.info[there]) +
                    squares[2] * rho_info * harmonic(a.count[own], b.count[there]);
    return s < kMost ? s : kMost;
  }

  Step of_block(int x0, int y0) const {
    Step best;
    float least = cost(x0, y0, best);
    const auto try_around = [&](Step centre, int pace, int rings) {
      for (int ring = 1; ring <= rings; ++ring) {
        for (int v = -ring; v <= ring; ++v) {
          for (int u = -ring; u <= ring; ++u) {
            if (std::max(std::abs(u), std::abs(v)) != ring) continue;
            const Step step{.x = centre.x + u * pace, .y = centre.y + v * pace};
            if (const float own = cost(x0, y0, step); own < least - kGain) {
              least = own;
              best = step;
            }
          }
        }
      }
    };
    if (least < kGain) return best;
    try_around({}, kEvery_px, kLongest_px / kEvery_px);
    for (int pace = kEvery_px / 2; pace > 0; pace /= 2) try_around(best, pace, 1);
    return best;
  }

 private:
  float cost(int x0, int y0, Step step) const {
    float sum = 0.0f;
    int count = 0;
    const int right = std::min(x0 + kBlock_px + kRim_px, pilot_.area.width);
    const int bottom = std::min(y0 + kBlock_px + kRim_px, pilot_.area.height);
    for (int y = std::max(y0 - kRim_px, 0); y < bottom; y += kEvery_px) {
      for (int x = std::max(x0 - kRim_px, 0); x < right; x += kEvery_px) {
        const size_t own = pilot_.area.at(x, y);
        if (pilot_.samples.object[own] == 0.0f) continue;
        size_t there = 0;
        sum += place(x, y, step, there) ? difference(own, there) : kMost;
        ++count;
      }
    }
    return count > 0 ? sum / static_cast<float>(count) : 0.0f;
  }

  const SmoothPilot& pilot_;
  const SmoothPilot& other_;
  const Step offset_;
};

// Sums over 2 kMean_px + 1 pixels along each row.
void sum_along_row(const SmoothArea& area, int y, const Plane& from, Plane& to) {
  float sum = 0.0f;
  const float* const row = &from[area.at(0, y)];
  float* const out = &to[area.at(0, y)];
  for (int x = -kMean_px; x <= kMean_px; ++x) sum += row[x];
  for (int x = 0; x < area.width; ++x) {
    out[x] = sum;
    sum += row[x + kMean_px + 1] - row[x - kMean_px];
  }
}

class Joiner {
 public:
  Joiner(const SmoothPilot& pilot, const SmoothPilot& other, int thread_count)
      : pilot_(pilot), other_(other), matcher_(pilot, other), thread_count_(thread_count) {
    const SmoothArea& area = pilot.area;
    across_ = (area.width + kBlock_px - 1) / kBlock_px;
    const int down = (area.height + kBlock_px - 1) / kBlock_px;
    steps_.resize(static_cast<size_t>(across_) * static_cast<size_t>(down));
    for_rows(down, thread_count, [&](int first, int last) {
      for (int j = first; j < last; ++j) {
        for (int i = 0; i < across_; ++i)
          steps_[static_cast<size_t>(j * across_ + i)] = matcher_.of_block(i * kBlock_px, j * kBlock_px);
      }
    });
  }

  // Sums of weight and weight times sample grow in `sums`.
  void add_to(SmoothSamples& sums, Plane& rho_weight) const {
    const SmoothArea& area = pilot_.area;
    Plane difference(area.size()), found(area.size()), summed(area.size()), counted(area.size());
    for_rows(area.height, thread_count_, [&](int first, int last) {
      for (int y = first; y < last; ++y) {
        each_found(y, [&](size_t own, size_t there) {
          difference[own] = matcher_.difference(own, there);
          found[own] = 1.0f;
        });
        sum_along_row(area, y, difference, summed);
        sum_along_row(area, y, found, counted);
      }
    });
    for_rows(area.height, thread_count_, [&](int first, int last) {
      for (int y = first; y < last; ++y) {
        each_found(y, [&](size_t own, size_t there) {
          float sum = 0.0f, count = 0.0f;
          for (int v = -kMean_px; v <= kMean_px; ++v) {
            const size_t at =
                own + static_cast<size_t>(v + kMean_px) * area.stride() - kMean_px * area.stride();
            sum += summed[at];
            count += counted[at];
          }
          const float agreement = std::clamp(2.0f - difference[own] / 8.0f, 0.0f, 1.0f) *
                                  std::clamp(2.0f - sum / (4.0f * count), 0.0f, 1.0f);
          const float weight = agreement * other_.samples.info[there];
          if (weight <= 0.0f) return;
          sums.info[own] += weight;
          rho_weight[own] += agreement;
          for (size_t k = 0; k < 2; ++k) sums.value[k][own] += weight * other_.samples.value[k][there];
          sums.value[2][own] += agreement * other_.samples.value[2][there];
        });
      }
    });
  }

 private:
  template <typename Use>
  void each_found(int y, const Use& use) const {
    for (int x = 0; x < pilot_.area.width; ++x) {
      const size_t own = pilot_.area.at(x, y);
      if (pilot_.samples.object[own] == 0.0f) continue;
      size_t there = 0;
      if (matcher_.place(x, y, steps_[static_cast<size_t>((y / kBlock_px) * across_ + x / kBlock_px)], there))
        use(own, there);
    }
  }

  const SmoothPilot& pilot_;
  const SmoothPilot& other_;
  const Matcher matcher_;
  const int thread_count_;
  int across_ = 0;
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
    // Where nothing is known, rho is not to be believed either.
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
