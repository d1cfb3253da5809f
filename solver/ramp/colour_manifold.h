// The ramp's colours as the camera sees them: a curved surface in the rgb cube, and the position on it that a
// colour's direction from black determines.
//
//   T_c(x, y) = (ramp's plane)_c + sum_ij k_cij P_i(s) P_j(t),  i + j <= 6, P Legendre's polynomials, s and t
//   over the part of the monitor that was measured; beyond it they continue linearly.
//
// A line from black through a colour C meets the plane n . C = 2 at (a, b), its light of the ramp's red and
// green. A table over (a, b) holds, for each direction D with n . D = 2, the position c whose colour is
// nearest to the line, and rho = D . T(c) / T(c)^2. It is solved once by Gauss-Newton on the model and
// interpolated bilinearly; on a flat manifold it is exact. Where the line misses the monitor, so that c would
// lie beyond its edge, a second table holds the nearest point of the edge.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cmath>
#include <span>
#include <vector>

namespace glasswing {

struct ManifoldSample {
  double x_px = 0.0, y_px = 0.0;  // monitor
  std::array<double, 3> light{};
};

class ColourManifold {
 public:
  using Light = std::array<double, 3>;

  // `mix`: the response of each camera channel (row) to each primary (column), by rows. FAILED_PRECONDITION:
  // too few samples.
  static absl::StatusOr<ColourManifold> fit(std::span<const ManifoldSample> samples,
                                            const std::array<double, 9>& mix, int monitor_width_px,
                                            int monitor_height_px);

  // T at a position on the monitor.
  Light light(double x_px, double y_px) const;

  // The colours of some pixels and the results for them.
  struct Colours {
    static constexpr size_t kMax = 64;
    using Values = std::array<float, kMax>;
    std::array<Values, 3> light, variance;      // of the channels
    Values x_px, y_px;                          // c
    Values rho;                                 // not clamped
    std::array<Values, 3> information_per_px2;  // xx, xy, yy: inverse covariance of c
  };
  // Solves the first `count` colours, which must have level() > 0.
  void find(Colours& colours, size_t count) const;
  // n . C / 2: 1 on the plane.
  float level(float r, float g, float b) const { return level_[0] * r + level_[1] * g + level_[2] * b; }

  // The variance of level(), and on the manifold of rho, for these variances of the channels.
  float level_variance(const std::array<float, 3>& variance) const {
    return level_[0] * level_[0] * variance[0] + level_[1] * level_[1] * variance[1] +
           level_[2] * level_[2] * variance[2];
  }

  // Standard deviation of the colours from the model.
  double residual() const { return residual_; }

 private:
  static constexpr int kDegree = 6, kTerms = (kDegree + 1) * (kDegree + 2) / 2;
  static constexpr int kCells = 160;  // per side of the table

  // x, y, rho and padding.
  using Node = std::array<float, 4>;
  struct Sides {
    Light light, along_x, along_y;
  };
  ColourManifold() = default;
  Sides sides(double x_px, double y_px) const;
  void set_mix(const std::array<double, 9>& mix);
  void frame_table();
  void fill_table();
  // `held`: restricted to the monitor.
  std::array<double, 2> nearest(const Light& direction, std::array<double, 2> start, bool held) const;

  double width_px_ = 0.0, height_px_ = 0.0;
  std::array<double, 9> mix_{};
  std::array<double, 9> ramp_of_light_{};  // rows: r, g and level of the ramp, linear in light
  std::array<float, 3> level_{}, to_a_{}, to_b_{};
  std::array<float, 2> from_{}, scale_{};  // cell of the table = (a - from) * scale
  std::array<double, 4> measured_px_{};    // x from, to, y from, to
  std::array<std::array<double, kTerms>, 3> terms_{};
  double residual_ = 0.0;
  // (kCells + 1)^2 nodes, by rows of b. held_: restricted to the monitor.
  std::vector<Node> table_, held_;
  std::vector<std::array<float, 4>> slope_;  // of the cells: d(x, y) / d(a, b), px
};

}  // namespace glasswing
