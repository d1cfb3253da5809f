#include "solver/ramp/colour_manifold.h"

#include <Eigen/Dense>
#include <algorithm>

#include "solver/ramp/colour_manifold_kernel.h"

namespace glasswing {
namespace {

// P_0 .. P_degree at s, and their derivatives; extended linearly beyond [-1, 1].
template <size_t Count>
void legendre(double s, std::array<double, Count>& value, std::array<double, Count>& slope) {
  const double inside = std::clamp(s, -1.0, 1.0);
  value[0] = 1.0;
  slope[0] = 0.0;
  value[1] = inside;
  slope[1] = 1.0;
  for (size_t i = 2; i < Count; ++i) {
    const double n = static_cast<double>(i);
    value[i] = ((2.0 * n - 1.0) * inside * value[i - 1] - (n - 1.0) * value[i - 2]) / n;
    slope[i] = slope[i - 2] + (2.0 * n - 1.0) * value[i - 1];
  }
  for (size_t i = 0; i < Count; ++i) value[i] += (s - inside) * slope[i];
}

// Each term's factors: (i, j) in the order of `terms_`.
template <int Degree, typename Visit>
void for_terms(const Visit& visit) {
  size_t term = 0;
  for (size_t i = 0; i <= Degree; ++i) {
    for (size_t j = 0; i + j <= Degree; ++j) visit(term++, i, j);
  }
}

ColourManifold::Light ramp_at(double u, double v) {
  return {0.1 + 0.8 * u, 0.1 + 0.8 * v, 0.9 - 0.4 * u - 0.4 * v};
}

double dot(const ColourManifold::Light& a, const ColourManifold::Light& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

ColourManifold::Light times(const std::array<double, 9>& matrix, const ColourManifold::Light& light) {
  ColourManifold::Light out{};
  for (size_t row = 0; row < 3; ++row)
    out[row] = matrix[3 * row] * light[0] + matrix[3 * row + 1] * light[1] + matrix[3 * row + 2] * light[2];
  return out;
}

}  // namespace

void ColourManifold::set_mix(const std::array<double, 9>& mix) {
  mix_ = mix;
  const Eigen::Matrix3d inverse =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(mix.data()).inverse();
  for (size_t c = 0; c < 3; ++c) {
    const auto column = static_cast<Eigen::Index>(c);
    to_a_[c] = static_cast<float>(inverse(0, column));
    to_b_[c] = static_cast<float>(inverse(1, column));
    level_[c] = static_cast<float>(0.5 * (inverse(0, column) + inverse(1, column)) + inverse(2, column));
  }
}

absl::StatusOr<ColourManifold> ColourManifold::fit(std::span<const ManifoldSample> samples,
                                                   const std::array<double, 9>& mix, int monitor_width_px,
                                                   int monitor_height_px) {
  if (samples.size() < 4 * kTerms) {
    return absl::FailedPreconditionError(
        "too little of the ramp is seen without the object to measure its colours");
  }
  ColourManifold manifold;
  manifold.width_px_ = monitor_width_px;
  manifold.height_px_ = monitor_height_px;
  manifold.set_mix(mix);
  auto& range = manifold.measured_px_;
  range = {manifold.width_px_, 0.0, manifold.height_px_, 0.0};
  for (const ManifoldSample& sample : samples) {
    range = {std::min(range[0], sample.x_px), std::max(range[1], sample.x_px),
             std::min(range[2], sample.y_px), std::max(range[3], sample.y_px)};
  }
  if (range[1] - range[0] < 1.0 || range[3] - range[2] < 1.0)
    return absl::FailedPreconditionError("hardly any of the ramp is seen without the object");

  using Terms = Eigen::Matrix<double, kTerms, 1>;
  std::vector<double> weights(samples.size(), 1.0);
  std::vector<double> misfit(samples.size());
  Eigen::Matrix<double, kTerms, 3> solution;
  // Twice, the second time without the outliers of the first: dust, a dead pixel, the monitor's rim.
  for (int round = 0; round < 2; ++round) {
    Eigen::Matrix<double, kTerms, kTerms> squares = Eigen::Matrix<double, kTerms, kTerms>::Zero();
    Eigen::Matrix<double, kTerms, 3> sums = Eigen::Matrix<double, kTerms, 3>::Zero();
    const auto row_of = [&](const ManifoldSample& sample) {
      std::array<double, kDegree + 1> p, q, unused;
      legendre(2.0 * (sample.x_px - range[0]) / (range[1] - range[0]) - 1.0, p, unused);
      legendre(2.0 * (sample.y_px - range[2]) / (range[3] - range[2]) - 1.0, q, unused);
      Terms row;
      for_terms<kDegree>([&](size_t term, size_t i, size_t j) { row[term] = p[i] * q[j]; });
      return row;
    };
    const auto beyond_plane = [&](const ManifoldSample& sample) {
      const Light base =
          times(mix, ramp_at(sample.x_px / manifold.width_px_, sample.y_px / manifold.height_px_));
      return Eigen::RowVector3d(sample.light[0] - base[0], sample.light[1] - base[1],
                                sample.light[2] - base[2]);
    };
    for (size_t i = 0; i < samples.size(); ++i) {
      if (weights[i] == 0.0) continue;
      const Terms row = row_of(samples[i]);
      squares.selfadjointView<Eigen::Lower>().rankUpdate(row);
      sums += row * beyond_plane(samples[i]);
    }
    solution = squares.selfadjointView<Eigen::Lower>().ldlt().solve(sums);
    for (size_t i = 0; i < samples.size(); ++i)
      misfit[i] = (beyond_plane(samples[i]) - row_of(samples[i]).transpose() * solution).norm();
    std::vector<double> sorted = misfit;
    const auto middle = sorted.begin() + sorted.size() / 2;
    std::nth_element(sorted.begin(), middle, sorted.end());
    manifold.residual_ = *middle / 1.538;  // the median length of three normal numbers
    for (size_t i = 0; i < samples.size(); ++i)
      weights[i] = misfit[i] <= std::max(5.0 * manifold.residual_, 1e-6) ? 1.0 : 0.0;
  }
  if (!solution.allFinite()) return absl::FailedPreconditionError("the ramp's colours do not form a surface");
  for (size_t c = 0; c < 3; ++c) {
    for (size_t term = 0; term < kTerms; ++term) manifold.terms_[c][term] = solution(term, c);
  }
  manifold.fill_table();
  return manifold;
}

ColourManifold::Sides ColourManifold::sides(double x_px, double y_px) const {
  Sides out{.light = times(mix_, ramp_at(x_px / width_px_, y_px / height_px_)),
            .along_x = times(mix_, {0.8 / width_px_, 0.0, -0.4 / width_px_}),
            .along_y = times(mix_, {0.0, 0.8 / height_px_, -0.4 / height_px_})};
  const double wide = measured_px_[1] - measured_px_[0], high = measured_px_[3] - measured_px_[2];
  const double s = 2.0 * (x_px - measured_px_[0]) / wide - 1.0,
               t = 2.0 * (y_px - measured_px_[2]) / high - 1.0;
  std::array<double, kDegree + 1> p, q, ps, qs;
  legendre(s, p, ps);
  legendre(t, q, qs);
  const double ds = 2.0 / wide, dt = 2.0 / high;
  for_terms<kDegree>([&](size_t term, size_t i, size_t j) {
    for (size_t c = 0; c < 3; ++c) {
      out.light[c] += terms_[c][term] * p[i] * q[j];
      out.along_x[c] += terms_[c][term] * ps[i] * q[j] * ds;
      out.along_y[c] += terms_[c][term] * p[i] * qs[j] * dt;
    }
  });
  return out;
}

ColourManifold::Light ColourManifold::light(double x_px, double y_px) const {
  return sides(x_px, y_px).light;
}

void ColourManifold::find(Colours& colours, size_t count) const {
  internal::find_colours({.row = kCells + 1,
                          .most = kCells - 1e-3f,
                          .level = level_,
                          .to_a = to_a_,
                          .to_b = to_b_,
                          .from = from_,
                          .scale = scale_,
                          .width_px = static_cast<float>(width_px_),
                          .height_px = static_cast<float>(height_px_),
                          .nodes = table_.data()->data(),
                          .held = held_.data()->data(),
                          .slopes = slope_.data()->data()},
                         colours, count);
}

// The position where T is nearest to the line along `direction`, by projected Gauss-Newton: a coordinate that
// would leave the monitor is held at its edge and the other solved again.
std::array<double, 2> ColourManifold::nearest(const Light& direction, std::array<double, 2> start,
                                              bool held) const {
  const std::array<double, 2> most{width_px_, height_px_};
  std::array<double, 2> at = start;
  if (held) at = {std::clamp(start[0], 0.0, most[0]), std::clamp(start[1], 0.0, most[1])};
  const double length = dot(direction, direction);
  const auto across = [&](Light light) {
    const double along = dot(light, direction) / length;
    for (size_t c = 0; c < 3; ++c) light[c] -= along * direction[c];
    return light;
  };
  for (int round = 0; round < 30; ++round) {
    const Sides here = sides(at[0], at[1]);
    const Light miss = across(here.light), dx = across(here.along_x), dy = across(here.along_y);
    const double xx = dot(dx, dx), xy = dot(dx, dy), yy = dot(dy, dy), gx = -dot(dx, miss),
                 gy = -dot(dy, miss);
    const double determinant = xx * yy - xy * xy;
    std::array<double, 2> next = at;
    if (determinant > 1e-12 * xx * yy) {
      next = {at[0] + (yy * gx - xy * gy) / determinant, at[1] + (xx * gy - xy * gx) / determinant};
    }
    const bool x_out = next[0] < 0.0 || next[0] > most[0], y_out = next[1] < 0.0 || next[1] > most[1];
    if (held && (x_out || y_out)) {
      // The best position on either edge that the step crosses.
      double least = INFINITY;
      std::array<double, 2> best = at;
      for (size_t axis = 0; axis < 2; ++axis) {
        if (!(axis == 0 ? x_out : y_out)) continue;
        std::array<double, 2> edge = at;
        edge[axis] = std::clamp(next[axis], 0.0, most[axis]);
        const double moved = edge[axis] - at[axis];
        const size_t other = 1 - axis;
        const double step = axis == 0 ? (gy - xy * moved) / yy : (gx - xy * moved) / xx;
        edge[other] = std::clamp(at[other] + step, 0.0, most[other]);
        const Light there = across(light(edge[0], edge[1]));
        if (dot(there, there) < least) {
          least = dot(there, there);
          best = edge;
        }
      }
      next = best;
    }
    const double moved = std::hypot(next[0] - at[0], next[1] - at[1]);
    at = next;
    if (moved < 1e-7 * (width_px_ + height_px_)) break;
  }
  return at;
}

// The table covers the range of the monitor's colours plus an eighth on each side.
void ColourManifold::frame_table() {
  constexpr int kSteps = 64;
  std::array<double, 2> least{INFINITY, INFINITY}, most{-INFINITY, -INFINITY};
  for (int j = 0; j <= kSteps; ++j) {
    for (int i = 0; i <= kSteps; ++i) {
      const Light here = light(width_px_ * i / kSteps, height_px_ * j / kSteps);
      const auto part = [&](const std::array<float, 3>& of) {
        return of[0] * here[0] + of[1] * here[1] + of[2] * here[2];
      };
      const std::array<double, 2> at{part(to_a_) / part(level_), part(to_b_) / part(level_)};
      for (size_t axis = 0; axis < 2; ++axis) {
        least[axis] = std::min(least[axis], at[axis]);
        most[axis] = std::max(most[axis], at[axis]);
      }
    }
  }
  for (size_t axis = 0; axis < 2; ++axis) {
    const double margin = 0.125 * (most[axis] - least[axis]);
    from_[axis] = static_cast<float>(least[axis] - margin);
    scale_[axis] = static_cast<float>(kCells / (most[axis] - least[axis] + 2.0 * margin));
  }
}

void ColourManifold::fill_table() {
  constexpr size_t kSide = kCells + 1;
  table_.resize(kSide * kSide);
  held_.resize(kSide * kSide);
  frame_table();
  slope_.resize(kSide * kSide);
  for (size_t row = 0; row < kSide; ++row) {
    for (size_t column = 0; column < kSide; ++column) {
      const double a = from_[0] + static_cast<double>(column) / scale_[0];
      const double b = from_[1] + static_cast<double>(row) / scale_[1];
      const double u = (a - 0.1) / 0.8, v = (b - 0.1) / 0.8;
      const Light direction = times(mix_, {a, b, 1.0 - 0.5 * (a + b)});
      const std::array<double, 2> guess{u * width_px_, v * height_px_};
      const auto node_at = [&](const std::array<double, 2>& place) {
        const Light here = light(place[0], place[1]);
        return Node{static_cast<float>(place[0]), static_cast<float>(place[1]),
                    static_cast<float>(dot(direction, here) / dot(here, here)), 0.0f};
      };
      const std::array<double, 2> place = nearest(direction, guess, false);
      const size_t node = row * kSide + column;
      table_[node] = node_at(place);
      const bool on_monitor =
          place[0] >= 0.0 && place[0] <= width_px_ && place[1] >= 0.0 && place[1] <= height_px_;
      held_[node] = on_monitor ? table_[node] : node_at(nearest(direction, guess, true));
      const Sides here = sides(place[0], place[1]);
      // d(a, b) / d(x, y) of the colours here, inverted.
      const auto per = [&](const std::array<float, 3>& to, const Light& along) {
        double top = 0.0, top_along = 0.0, bottom = 0.0, bottom_along = 0.0;
        for (size_t c = 0; c < 3; ++c) {
          top += to[c] * here.light[c];
          top_along += to[c] * along[c];
          bottom += level_[c] * here.light[c];
          bottom_along += level_[c] * along[c];
        }
        return (top_along - top / bottom * bottom_along) / bottom;
      };
      Eigen::Matrix2d forward;
      forward << per(to_a_, here.along_x), per(to_a_, here.along_y), per(to_b_, here.along_x),
          per(to_b_, here.along_y);
      const Eigen::Matrix2d slope = forward.inverse();
      slope_[node] = {static_cast<float>(slope(0, 0)), static_cast<float>(slope(0, 1)),
                      static_cast<float>(slope(1, 0)), static_cast<float>(slope(1, 1))};
    }
  }
}

}  // namespace glasswing
