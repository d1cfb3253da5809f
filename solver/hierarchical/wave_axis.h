// Finds the interval along one axis of a monitor that a pixel sees, from square waves of several widths:
//
//   v_k(a, b) = (P_k(b) - P_k(a)) / (b - a),     P_k(t) = \int_0^t s_k(t') dt'
//
// is the mean over [a, b] of a wave s_k = +-1, +1 on its lit bars. The interval minimises
//
//   sum_k w_k (u_k - v_k(a, b))^2 + (b - a) / extent
//
// for the measured u_k, where w_k is the inverse of their variance. (Bars that share edges make some
// intervals indistinguishable; the last term, small against noise, selects the shortest of these.) It is one
// side of the rectangle of Zongker et al. 1999 (Chuang et al. 2000, eq. 8). P_k is a table of sums, linear
// between its entries because a monitor's pixels are flat.
#pragma once

#include <array>
#include <cstdint>
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

  // 1 to kMaxWaves waves, rasterised to whole pixels by their value at the centres.
  WaveAxis(std::span<const BarWave> waves, int extent_px);

  size_t wave_count() const { return wave_count_; }
  double finest_bar_px() const { return finest_bar_px_; }
  // search() examines ends on this grid: a quarter of a pixel if there are bars narrower than two, otherwise
  // one pixel.
  double grid_px() const { return 1.0 / per_px_; }

  // Two positions further apart than the finest bar that all waves show alike, for example because one wave
  // was left out; none if all can be distinguished.
  std::optional<std::array<double, 2>> alike_px() const;
  // After so many pixels all waves begin anew; none if that is not on the monitor.
  std::optional<double> period_px() const { return period_px_; }

  struct Seen {
    float u = 0.0f;
    float weight = 0.0f;  // w, >= 0
  };

  // Where the waves are read as u. As a rule the middle of the positions at which each has the sign of its u:
  // the plain decode of a Gray or binary code. Where the edges of several waves coincide, as in a binary
  // code, signs near such an edge are of no use: there it is the position of the highest correlation of u and
  // v_k of a finest bar. None if no position has these signs; for more than kMaxDecoded waves.
  static constexpr size_t kMaxDecoded = 12;
  std::optional<double> decode(std::span<const Seen> seen) const;
  // Where the code is read, at least `apart_px` from t_px, if one wave has the other sign. At most one for
  // each wave, whose v_k (`model`) and u are not so far from 0 that this is out of the question: 4 w_k u_k
  // v_k < `price`.
  std::vector<double> misreadings(std::span<const Seen> seen, std::span<const double> model, double t_px,
                                  double apart_px, double price) const;

  // v_k of every wave.
  void means(const Interval& interval, std::span<double> v) const;
  struct SoftSide {
    double t_px = 0.0, sigma_px = 0.0;
  };
  // A Gaussian's means of waves that go on beyond the monitor, and their derivatives:
  //
  //   v = erf(d / (sqrt2 sigma)) + erf((b - d) / (sqrt2 sigma)) - 1              sigma < b / 4
  //     = 4 / pi sum_{n = 1, 3} exp(-(n pi sigma / b)^2 / 2) sin(n pi d / b) / n  beyond; error < 1e-4
  //
  // times the sign of the bar of b px that t lies in, d px from its start.
  struct SoftMeans {
    std::array<float, kMaxWaves> v, by_t, by_sigma;  // beyond the waves' count undefined
  };
  SoftMeans soft_means(const SoftSide& side) const;
  // Refines a Gaussian's centre and width from a start nearby, by Levenberg-Marquardt.
  SoftSide refine_soft(std::span<const Seen> seen, const SoftSide& start) const;
  // s_k at a point.
  double wave_at(size_t wave, double t_px) const;

  double cost(std::span<const Seen> seen, const Interval& interval) const;
  // Finds the interval on the grid with the lowest cost (up to float rounding), then shifts its ends in finer
  // steps down to kMinLength_px while that helps. One Seen per wave.
  //
  // Branch and bound, coarse to fine: a pair of cells for the two ends is split while the lower bound of its
  // cost, from the minimum and maximum of P_k in each cell, is below the best known cost. A hint of where the
  // interval may lie saves most of the splits; without length it is none.
  IntervalFit search(std::span<const Seen> seen, const Interval& hint = {}) const;
  // Refines a known interval: shifts its ends in ever finer steps while that helps.
  IntervalFit refine(std::span<const Seen> seen, const Interval& start) const;

 private:
  // Two cells of 2^level grid points each, one for each end.
  struct Node {
    int level = 0, low = 0, high = 0;
    float bound = 0.0f;
  };
  // By wave, padded with weight 0.
  struct Lanes;
  IntervalFit refine(const Lanes& seen, const Interval& start) const;
  // Bit k set where s_k > 0, of the first 32 waves.
  std::uint32_t signs_at(double t_px) const;
  bool edges_coincide() const;
  double scan(std::span<const Seen> seen) const;
  double cost(const Lanes& seen, const Interval& interval) const;
  // The parts of a node whose bounds are below `enough`, the best last; returns their count.
  size_t split(const Lanes& seen, const Node& node, float enough, std::array<Node, 4>& parts) const;
  // The interval on the grid with the lowest cost around another one.
  IntervalFit on_grid(const Lanes& seen, const Interval& around) const;
  // Shifts either end or both by a step to where the cost is lowest; false if that is here.
  bool shift(const Lanes& seen, double step_px, IntervalFit& best) const;
  // The minimum of P over a cell, by wave; the maximum follows stride_ later.
  const float* least(int level, int cell) const {
    return cells_.data() + (first_cell_[level] + static_cast<size_t>(cell)) * 2 * stride_;
  }

  // Where all waves have these signs, bit k set where s_k > 0: the first and the last such place.
  struct Reading {
    float from_px = 0.0f, to_px = -1.0f;
  };
  std::vector<Reading> readings_;  // empty if there are too many waves
  std::vector<float> scanned_;     // [point][wave]: v_k of a finest bar, by half bars; if edges coincide

  std::vector<BarWave> waves_;
  std::vector<float> bars_px_, offsets_px_;  // of the waves, padded
  size_t wave_count_ = 0, stride_ = 0;
  int per_px_ = 1;  // grid points per pixel
  int last_point_ = 0;
  double extent_px_ = 0.0, finest_bar_px_ = 0.0;
  std::optional<double> period_px_;
  std::vector<float> sums_;         // [point][wave]: P in grid steps: integers
  std::vector<float> cells_;        // [level][cell][min, max][wave]
  std::vector<size_t> first_cell_;  // by level
};

}  // namespace glasswing
