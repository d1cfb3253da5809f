// Where along one axis of a monitor a pixel looks, as one interval, from square waves of several widths:
//
//   v_k(a, b) = (P_k(b) - P_k(a)) / (b - a),     P_k(t) = \int_0^t s_k(t') dt'
//
// is what the interval [a, b] sees of a wave s_k = +-1, +1 on its lit bars. Sought is the interval with the
// least
//
//   sum_k w_k (u_k - v_k(a, b))^2 + (b - a) / extent
//
// for the u_k that were seen, w_k the inverse of their variance. (Bars that share edges leave some intervals
// alike; the last term, as small against noise as it is, takes the shortest of these.) It is one side of the
// rectangle of Zongker et al. 1999 (Chuang et al. 2000, eq. 8). P_k is a table of sums, straight between its
// entries because a monitor's pixels are flat.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

namespace glasswing {

struct BarWave {
  double bar_px = 1.0;     // width of a bar, at least 1
  double offset_px = 0.0;  // where a lit bar begins
};

struct Interval {
  double low_px = 0.0, high_px = 0.0;  // 0 <= low < high <= extent
  double centre_px() const { return 0.5 * (low_px + high_px); }
  double length_px() const { return high_px - low_px; }
};

struct IntervalFit {
  Interval interval;
  double cost = 0.0;
};

class WaveAxis {
 public:
  static constexpr size_t kMaxWaves = 32;
  static constexpr double kMinLength_px = 1.0 / 64.0;

  // 1 to kMaxWaves waves, drawn on whole pixels by their value at the centres.
  WaveAxis(std::span<const BarWave> waves, int extent_px);

  size_t wave_count() const { return wave_count_; }
  double finest_bar_px() const { return finest_bar_px_; }
  // Ends on this grid are what search() looks through: a quarter of a pixel if there are bars of less than
  // two, else one.
  double grid_px() const { return 1.0 / per_px_; }

  // Two places further apart than the finest bar that all waves show alike, as where one of them was left
  // out; none if they can be told apart.
  std::optional<std::array<double, 2>> alike_px() const;

  // v_k of every wave.
  void means(const Interval& interval, std::span<double> v) const;
  // s_k at a point.
  double wave_at(size_t wave, double t_px) const;

  struct Seen {
    float u = 0.0f;
    float weight = 0.0f;  // w, >= 0
  };
  double cost(std::span<const Seen> seen, const Interval& interval) const;
  // Of all intervals on the grid none has a lower cost (but for a float's rounding); then its ends are
  // shifted by less, down to kMinLength_px, while that helps. One Seen a wave.
  //
  // Coarse to fine: ends lie in cells, a pair of cells is halved while a bound on its least cost, from the
  // least and most of P_k in each, is below the best cost known.
  IntervalFit search(std::span<const Seen> seen) const;
  // From an interval that is known: shifts of its ends, in finer and finer steps, while they help.
  IntervalFit refine(std::span<const Seen> seen, const Interval& start) const;

 private:
  // Ends that lie in two cells of 2^level points of the grid each.
  struct Node {
    int level = 0, low = 0, high = 0;
    float bound = 0.0f;
  };
  // By wave, padded with weight 0.
  struct Lanes;
  IntervalFit refine(const Lanes& seen, const Interval& start) const;
  double cost(const Lanes& seen, const Interval& interval) const;
  float bound(const Lanes& seen, const Node& node) const;
  // The least of P over a cell, by wave; stride_ further on the most.
  const float* least(int level, int cell) const {
    return cells_.data() +
           (first_cell_[static_cast<size_t>(level)] + static_cast<size_t>(cell)) * 2 * stride_;
  }

  size_t wave_count_ = 0, stride_ = 0;
  int per_px_ = 1;  // points of the grid a pixel
  int last_point_ = 0;
  double extent_px_ = 0.0, finest_bar_px_ = 0.0;
  std::vector<float> sums_;         // [point][wave]: P, in steps of the grid: whole numbers
  std::vector<float> cells_;        // [level][cell][least, most][wave]
  std::vector<size_t> first_cell_;  // by level
};

}  // namespace glasswing
