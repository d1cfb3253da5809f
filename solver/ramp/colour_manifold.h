// The colours of the ramp as the camera sees them: a curved surface in the rgb cube, and the place on it that
// a colour's direction from black tells.
//
//   T_c(x, y) = (ramp's plane)_c + sum_ij k_cij P_i(s) P_j(t),  i + j <= 6, P Legendre's polynomials, s and t
//   over the part of the monitor that was measured; beyond it the sum stays as at its edge.
//
// A line from black through a colour C meets the plane n . C = 2 at (u, v), two coordinates of its direction.
// A table over these holds, for each direction D with n . D = 2, the place c of the monitor whose colour is
// nearest to the line, on the edge where the line misses, and rho = D . T(c) / T(c)^2: solved once by
// Gauss-Newton on the model, bilinear in between. On a manifold that is plane the table is exact.
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

  // `mix`: what each of the camera's channels (row) sees of each primary (column), by rows.
  // FAILED_PRECONDITION: too few samples to tell.
  static absl::StatusOr<ColourManifold> fit(std::span<const ManifoldSample> samples,
                                            const std::array<double, 9>& mix, int monitor_width_px,
                                            int monitor_height_px);

  // T at a place of the monitor.
  Light light(double x_px, double y_px) const;

  struct Found {
    float x_px, y_px;
    float rho;      // not clamped
    float outside;  // how far beyond the monitor's edge the direction points, shares of its sides
  };
  // Of light that is not 0 or less in all: level() > 0.
  Found find(float r, float g, float b) const;
  // n . C / 2: 1 on the plane.
  float level(float r, float g, float b) const { return level_[0] * r + level_[1] * g + level_[2] * b; }

  // Standard deviation of level(), and on the manifold of rho, of light with these variances of its channels.
  float level_sd(const std::array<float, 3>& variance) const {
    float sum = 0.0f;
    for (size_t c = 0; c < 3; ++c) sum += level_[c] * level_[c] * variance[c];
    return std::sqrt(sum);
  }

  // Inverse covariance of c, xx, xy, yy, 1/px^2, of this light with these variances of its channels.
  std::array<float, 3> information(float r, float g, float b, const std::array<float, 3>& variance) const;

  // Standard deviation of the colours from the model.
  double residual() const { return residual_; }

 private:
  static constexpr int kDegree = 6, kTerms = (kDegree + 1) * (kDegree + 2) / 2;
  static constexpr int kCells = 160;        // a side of the table
  static constexpr double kMargin = 0.125;  // of (u, v) beyond [0, 1]

  struct Node {
    float x_px, y_px, rho;
  };
  struct Sides {
    Light light, along_x, along_y;
  };
  ColourManifold() = default;
  Sides sides(double x_px, double y_px) const;
  void fill_table();
  std::array<double, 2> nearest(const Light& direction, std::array<double, 2> start) const;

  double width_px_ = 0.0, height_px_ = 0.0;
  std::array<double, 9> mix_{};
  std::array<double, 9> ramp_of_light_{};  // rows: r, g and level of the ramp, linear in light
  std::array<float, 3> level_{}, to_u_{}, to_v_{};
  std::array<double, 4> measured_px_{};  // x from, to, y from, to
  std::array<std::array<double, kTerms>, 3> terms_{};
  double residual_ = 0.0;
  std::vector<Node> table_;                  // (kCells + 1)^2, by rows of v
  std::vector<std::array<float, 4>> slope_;  // of the cells: d(x, y) / d(u, v), px
};

inline ColourManifold::Found ColourManifold::find(float r, float g, float b) const {
  constexpr float kScale = kCells / static_cast<float>(1.0 + 2.0 * kMargin), kFrom = kMargin;
  const float per_level = 1.0f / level(r, g, b);
  const float u = (to_u_[0] * r + to_u_[1] * g + to_u_[2] * b) * per_level - 0.125f;
  const float v = (to_v_[0] * r + to_v_[1] * g + to_v_[2] * b) * per_level - 0.125f;
  const auto inside = [](float value) { return std::fmin(std::fmax(value, 0.0f), kCells - 1e-3f); };
  const float across = inside((u + kFrom) * kScale), down = inside((v + kFrom) * kScale);
  const int column = static_cast<int>(across), row = static_cast<int>(down);
  const float fx = across - static_cast<float>(column), fy = down - static_cast<float>(row);
  const Node* const top = &table_[static_cast<size_t>(row) * (kCells + 1) + static_cast<size_t>(column)];
  const Node* const low = top + kCells + 1;
  const auto blend = [&](float Node::*part) {
    const float above = top[0].*part + fx * (top[1].*part - top[0].*part);
    const float below = low[0].*part + fx * (low[1].*part - low[0].*part);
    return above + fy * (below - above);
  };
  const float off = std::fmax(std::fmax(-u, u - 1.0f), std::fmax(-v, v - 1.0f));
  return {.x_px = blend(&Node::x_px),
          .y_px = blend(&Node::y_px),
          .rho = blend(&Node::rho) / per_level,
          .outside = std::fmax(off, 0.0f)};
}

}  // namespace glasswing
