// The colours of the ramp as the camera sees them: a curved surface in the rgb cube, and the place on it that
// a colour's direction from black tells.
//
//   T_c(x, y) = (ramp's plane)_c + sum_ij k_cij P_i(s) P_j(t),  i + j <= 6, P Legendre's polynomials, s and t
//   over the part of the monitor that was measured; beyond it they go straight on.
//
// A line from black through a colour C meets the plane n . C = 2 at (a, b), its light of the ramp's red and
// green, which tell its direction. A table over these holds, for each direction D with n . D = 2, the place c
// whose colour is nearest to the line, and rho = D . T(c) / T(c)^2: solved once by Gauss-Newton on the model,
// bilinear in between. On a manifold that is plane the table is exact. Where the line misses the monitor, so
// that c would lie beyond its edge, a second table has the nearest point of the edge.
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
    float rho;  // not clamped
  };
  // Of light that is not 0 or less in all: level() > 0.
  Found find(float r, float g, float b) const;
  // n . C / 2: 1 on the plane.
  float level(float r, float g, float b) const { return level_[0] * r + level_[1] * g + level_[2] * b; }

  // Variance of level(), and on the manifold of rho, of light with these variances of its channels.
  float level_variance(const std::array<float, 3>& variance) const {
    return level_[0] * level_[0] * variance[0] + level_[1] * level_[1] * variance[1] +
           level_[2] * level_[2] * variance[2];
  }

  // Inverse covariance of c, xx, xy, yy, 1/px^2, of this light with these variances of its channels.
  std::array<float, 3> information(float r, float g, float b, const std::array<float, 3>& variance) const;

  // Standard deviation of the colours from the model.
  double residual() const { return residual_; }

 private:
  static constexpr int kDegree = 6, kTerms = (kDegree + 1) * (kDegree + 2) / 2;
  static constexpr int kCells = 160;  // a side of the table

  struct Node {
    float x_px, y_px, rho;
  };
  struct Sides {
    Light light, along_x, along_y;
  };
  ColourManifold() = default;
  Sides sides(double x_px, double y_px) const;
  void frame_table();
  void fill_table();
  // `held`: on the monitor.
  std::array<double, 2> nearest(const Light& direction, std::array<double, 2> start, bool held) const;

  double width_px_ = 0.0, height_px_ = 0.0;
  std::array<double, 9> mix_{};
  std::array<double, 9> ramp_of_light_{};  // rows: r, g and level of the ramp, linear in light
  std::array<float, 3> level_{}, to_a_{}, to_b_{};
  std::array<float, 2> from_{}, scale_{};  // cell of the table = (a - from) * scale
  std::array<double, 4> measured_px_{};    // x from, to, y from, to
  std::array<std::array<double, kTerms>, 3> terms_{};
  double residual_ = 0.0;
  // (kCells + 1)^2, by rows of b; the second: held on the monitor.
  std::vector<Node> table_, held_;
  std::vector<std::array<float, 4>> slope_;  // of the cells: d(x, y) / d(a, b), px
};

inline ColourManifold::Found ColourManifold::find(float r, float g, float b) const {
  const float per_level = 1.0f / level(r, g, b);
  const auto inside = [](float value) {
    const float positive = value > 0.0f ? value : 0.0f;
    return positive < kCells - 1e-3f ? positive : kCells - 1e-3f;
  };
  const float across =
      inside(((to_a_[0] * r + to_a_[1] * g + to_a_[2] * b) * per_level - from_[0]) * scale_[0]);
  const float down =
      inside(((to_b_[0] * r + to_b_[1] * g + to_b_[2] * b) * per_level - from_[1]) * scale_[1]);
  const int column = static_cast<int>(across), row = static_cast<int>(down);
  const float fx = across - static_cast<float>(column), fy = down - static_cast<float>(row);
  const size_t first = static_cast<size_t>(row) * (kCells + 1) + static_cast<size_t>(column);
  const auto look_up = [&](const std::vector<Node>& table) {
    const Node *const top = &table[first], *const low = top + kCells + 1;
    const auto blend = [&](float Node::*part) {
      const float above = top[0].*part + fx * (top[1].*part - top[0].*part);
      const float below = low[0].*part + fx * (low[1].*part - low[0].*part);
      return above + fy * (below - above);
    };
    return Found{
        .x_px = blend(&Node::x_px), .y_px = blend(&Node::y_px), .rho = blend(&Node::rho) / per_level};
  };
  const Found found = look_up(table_);
  const bool on_monitor = found.x_px >= 0.0f && found.x_px <= static_cast<float>(width_px_) &&
                          found.y_px >= 0.0f && found.y_px <= static_cast<float>(height_px_);
  return on_monitor ? found : look_up(held_);
}

inline std::array<float, 3> ColourManifold::information(float r, float g, float b,
                                                        const std::array<float, 3>& variance) const {
  const float per_level = 1.0f / level(r, g, b);
  const float top_a = (to_a_[0] * r + to_a_[1] * g + to_a_[2] * b) * per_level;
  const float top_b = (to_b_[0] * r + to_b_[1] * g + to_b_[2] * b) * per_level;
  float aa = 0.0f, ab = 0.0f, bb = 0.0f;
  for (size_t c = 0; c < 3; ++c) {
    const float da = to_a_[c] - top_a * level_[c], db = to_b_[c] - top_b * level_[c];
    aa += variance[c] * da * da;
    ab += variance[c] * da * db;
    bb += variance[c] * db * db;
  }
  const auto cell = [&](float top, size_t axis) {
    const float at = (top - from_[axis]) * scale_[axis], positive = at > 0.0f ? at : 0.0f;
    return static_cast<size_t>(static_cast<int>(positive < kCells ? positive : kCells));
  };
  const std::array<float, 4>& s = slope_[cell(top_b, 1) * (kCells + 1) + cell(top_a, 0)];
  const float xa = s[0] * aa + s[1] * ab, xb = s[0] * ab + s[1] * bb, ya = s[2] * aa + s[3] * ab,
              yb = s[2] * ab + s[3] * bb;
  const float xx = xa * s[0] + xb * s[1], xy = xa * s[2] + xb * s[3], yy = ya * s[2] + yb * s[3];
  const float square = per_level * per_level, determinant = (xx * yy - xy * xy) * square;
  if (!(determinant > 0.0f)) return {0.0f, 0.0f, 0.0f};
  const float share = 1.0f / determinant;
  return {yy * share, -xy * share, xx * share};
}

}  // namespace glasswing
