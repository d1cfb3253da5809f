// The sums of joint_fit.h, a vector of samples at a time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/kernels/joint_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/footprint/cut_footprint.h"
#include "solver/gaussian/kernels/joint_fit.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, SampleLayout::kPad>;
using V = hn::Vec<D>;

constexpr double kReach = 4.7;  // sigmas; beyond, a mode is below 2e-5 of its peak

// Samples [begin, end) of a sweep: whole vectors.
struct Range {
  int begin = 0, end = 0;
};

Range Common(Range a, Range b) {
  return {std::max(a.begin, b.begin), std::min(a.end, b.end)};
}

double Total(V v) {
  const D d;
  return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, v)));
}

// Phi(a), and phi(a) with it. Abramowitz and Stegun 7.1.26: |error| < 1.5e-7.
V NormalIntegral(V a, V* density) {
  const D d;
  const V x = hn::Mul(hn::Abs(a), hn::Set(d, 0.70710678f));
  const V t = hn::Div(hn::Set(d, 1.0f), hn::MulAdd(x, hn::Set(d, 0.3275911f), hn::Set(d, 1.0f)));
  V p = hn::Set(d, 1.061405429f);
  p = hn::MulAdd(p, t, hn::Set(d, -1.453152027f));
  p = hn::MulAdd(p, t, hn::Set(d, 1.421413741f));
  p = hn::MulAdd(p, t, hn::Set(d, -0.284496736f));
  p = hn::MulAdd(p, t, hn::Set(d, 0.254829592f));
  const V e = hn::Exp(d, hn::Max(hn::Mul(hn::Set(d, -0.5f), hn::Mul(a, a)), hn::Set(d, -80.0f)));
  *density = hn::Mul(e, hn::Set(d, 0.39894228f));
  const V tail = hn::Mul(hn::Mul(hn::Set(d, 0.5f), hn::Mul(p, t)), e);  // Phi(-|a|)
  return hn::IfThenElse(hn::Lt(a, hn::Zero(d)), tail, hn::Sub(hn::Set(d, 1.0f), tail));
}

// An edge of the monitor across one axis: its place in standard deviations of the lit footprint, and the part
// of the footprint's density on it.
struct EdgeAt {
  float sign;          // of its part in the share: 1 at the high edge, -1 at the low one
  V z, part, density;  // Phi(z), phi(z)
};

// The places of the edges of one axis at the samples of a range. Those that are far from all of them, beyond
// kFarEdge, are left out.
struct Edges {
  double px[2];
  int count = 0;
  float sign[2];
  V whole;  // Phi of a high edge that is left out: 1
};

constexpr double kFarEdge = 5.5;

Edges Near(double low_px, double high_px, double mean_px, double per_pull, double sd_px, double first_pull,
           double last_pull) {
  const auto [from, to] = std::minmax({mean_px + per_pull * first_pull, mean_px + per_pull * last_pull});
  Edges edges{.px = {}, .sign = {}, .whole = hn::Zero(D())};
  if (from - low_px < kFarEdge * sd_px) edges.px[edges.count] = low_px, edges.sign[edges.count++] = -1.0f;
  if (high_px - to < kFarEdge * sd_px)
    edges.px[edges.count] = high_px, edges.sign[edges.count++] = 1.0f;
  else
    edges.whole = hn::Set(D(), 1.0f);
  return edges;
}

// The share of the lit footprint on the monitor, with the light of the edges' pixels, and the derivatives of
// the share by the mean and the covariance.
struct Inside {
  V with_edges;
  V by_x, by_y, by_xx, by_xy, by_yy;
};

// A cut footprint at the samples of one vector, where its means are mx, my.
class InsideAt {
 public:
  // `near` of x and of y. r: the stripe's place from where c.s is taken.
  InsideAt(const CutFootprint& cut, const Edges (&near)[2], const V (&mean)[2], V r_px)
      : cut_(cut), near_(near), mean_{mean[0], mean[1]}, r_px_(r_px) {
    for (int a = 0; a < 2; ++a) {
      for (int i = 0; i < near[a].count; ++i) {
        EdgeAt& edge = at_[a][i];
        edge.sign = near[a].sign[i];
        edge.z = hn::Mul(hn::Sub(Set(near[a].px[i]), mean[a]), Set(1.0 / sd(a)));
        edge.part = NormalIntegral(edge.z, &edge.density);
      }
    }
  }

  Inside Sums() const {
    const V zero = hn::Zero(D());
    V light = zero, corners = zero, line[2] = {zero, zero}, slope[2] = {zero, zero};
    for (int a = 0; a < 2; ++a) {
      for (int i = 0; i < near_[a].count; ++i) {
        const AlongEdge along = Along(a, i);
        line[a] = hn::Add(line[a], along.density);
        slope[a] = hn::MulAdd(along.density, at_[a][i].z, slope[a]);
        light = hn::Add(light, along.light);
        if (a == 0) corners = hn::Add(corners, along.at_corners);
      }
    }
    corners = hn::Mul(corners, Set(1.0 / cut_.corners.rest));
    const V turned = hn::Mul(corners, Set(cut_.corners.rho));
    const auto by_variance = [&](int a, bool clamped) {
      return clamped ? zero : hn::Mul(hn::Add(slope[a], turned), Set(-0.5 / (sd(a) * sd(a))));
    };
    return {.with_edges = hn::Add(Share(), light),
            .by_x = hn::Mul(line[0], Set(-1.0 / sd(0))),
            .by_y = hn::Mul(line[1], Set(-1.0 / sd(1))),
            .by_xx = by_variance(0, cut_.clamped_x),
            .by_xy = hn::Mul(corners, Set(1.0 / (sd(0) * sd(1)))),
            .by_yy = by_variance(1, cut_.clamped_y)};
  }

 private:
  // Of one edge, with its sign: the density on it, those at its ends, and the light of its pixels.
  struct AlongEdge {
    V density, at_corners, light;
  };

  static V Set(double v) { return hn::Set(D(), static_cast<float>(v)); }
  double sd(int a) const { return a == 0 ? cut_.sd_x_px : cut_.sd_y_px; }
  double axis(int a) const { return a == 0 ? cut_.cos_phi : cut_.sin_phi; }

  // normal_rectangle.h
  V Share() const {
    const D d;
    V part[2];
    for (int a = 0; a < 2; ++a) {
      part[a] = near_[a].whole;
      for (int i = 0; i < near_[a].count; ++i)
        part[a] = hn::MulAdd(hn::Set(d, at_[a][i].sign), at_[a][i].part, part[a]);
    }
    if (near_[0].count == 0 || near_[1].count == 0) return hn::Mul(part[0], part[1]);
    V share = hn::Mul(part[0], part[1]);
    if (cut_.corners.steep) {
      // Phi of the lower of two edges; an edge that is left out is never the lower one, or has no part.
      share = hn::Mul(near_[0].whole, near_[1].whole);
      for (int a = 0; a < 2; ++a) {
        for (int i = 0; i < near_[a].count; ++i)
          share = hn::MulAdd(hn::Mul(hn::Set(d, at_[a][i].sign), near_[1 - a].whole), at_[a][i].part, share);
      }
    }
    for (int i = 0; i < near_[0].count; ++i) {
      for (int j = 0; j < near_[1].count; ++j) share = hn::Add(share, Corner(at_[0][i], at_[1][j]));
    }
    return share;
  }

  V Corner(const EdgeAt& x, const EdgeAt& y) const {
    const D d;
    const NormalCorners& corners = cut_.corners;
    const V squares = hn::MulAdd(x.z, x.z, hn::Mul(y.z, y.z)), product = hn::Mul(Set(2.0), hn::Mul(x.z, y.z));
    V sum = corners.steep ? hn::Min(x.part, y.part) : hn::Zero(d);
    for (size_t n = 0; n < corners.node_count; ++n) {
      const V exponent =
          hn::Mul(hn::NegMulAdd(product, Set(corners.sine[n]), squares), Set(-corners.scale[n]));
      sum = hn::MulAdd(Set(corners.weight[n]), hn::Exp(d, hn::Max(exponent, Set(-80.0))), sum);
    }
    return hn::Mul(hn::Set(d, x.sign * y.sign), sum);
  }

  // Along the edge, the other coordinate has mean rho z and standard deviation `rest`.
  AlongEdge Along(int a, int i) const {
    const D d;
    const int b = 1 - a;
    const EdgeAt& edge = at_[a][i];
    const double rho = cut_.corners.rho, rest = cut_.corners.rest;
    V across = near_[b].whole, densities = hn::Zero(d);  // the share of the edge's line, and the ends' phi
    for (int j = 0; j < near_[b].count; ++j) {
      const V other = hn::Mul(hn::NegMulAdd(Set(rho), edge.z, at_[b][j].z), Set(1.0 / rest));
      V density;
      const V part = NormalIntegral(other, &density), sign = hn::Set(d, at_[b][j].sign);
      across = hn::MulAdd(sign, part, across);
      densities = hn::MulAdd(sign, density, densities);
    }
    const V own = hn::Mul(hn::Set(d, edge.sign), edge.density);
    const V place = hn::MulAdd(Set(rho * sd(b)), edge.z, mean_[b]);
    const V moment = hn::NegMulAdd(Set(sd(b) * rest), densities, hn::Mul(place, across));
    const V pull =
        hn::MulAdd(Set(axis(b)), moment, hn::Mul(hn::Sub(Set(near_[a].px[i] * axis(a)), r_px_), across));
    return {.density = hn::Mul(own, across),
            .at_corners = hn::Mul(own, densities),
            .light = hn::Mul(Set(axis(a) / (12.0 * cut_.stripe_variance_px2 * sd(a))), hn::Mul(own, pull))};
  }

  const CutFootprint& cut_;
  const Edges (&near_)[2];
  const V mean_[2];
  const V r_px_;
  EdgeAt at_[2][2];
};

// The six derivatives if the edge clips the mode; also subtracts the model from the residual. The light of
// the edges' pixels counts in the model and in the derivative by R only.
void CutColumns(const Footprint& mode, const SampleLayout::Sweep& sweep, const MonitorExtent& extent,
                const float* offset_px, float* residual, float* columns, size_t stride, Range range) {
  const D d;
  const CutFootprint cut(mode, sweep.axis, extent);
  const double c = sweep.axis.cos_phi, s = sweep.axis.sin_phi, turn = cut.mirrored ? -1.0 : 1.0;
  const double variance = cut.variance_px2, sigma = cut.sigma_px, gx = cut.gx_px2, gy = cut.gy_px2;
  // Derivatives by x, y, xx, xy, yy: of c.s, sigma_r^2, gx, gy, and of the lit footprint's covariance.
  const double d_centre[5] = {c, s, 0.0, 0.0, 0.0};
  const double d_variance[5] = {0.0, 0.0, c * c, 2.0 * c * s, s * s};
  const double d_gx[5] = {0.0, 0.0, c, s, 0.0};
  const double d_gy[5] = {0.0, 0.0, 0.0, turn * c, turn * s};
  const auto set = [&](double v) { return hn::Set(d, static_cast<float>(v)); };
  const auto pull_at = [&](int i) { return (offset_px[i] + sweep.first_r_px - cut.centre_px) / variance; };
  if (range.begin >= range.end) return;
  const double first = pull_at(range.begin), last = pull_at(range.end - 1);
  const Edges near[2] = {Near(cut.low_x_px, cut.high_x_px, cut.x_px, gx, cut.sd_x_px, first, last),
                         Near(cut.low_y_px, cut.high_y_px, cut.y_px, gy, cut.sd_y_px, first, last)};
  const V centre = set(cut.centre_px - sweep.first_r_px);
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
    const V offset = hn::LoadU(d, offset_px + i), t = hn::Sub(offset, centre);
    const V z = hn::Mul(t, set(1.0 / sigma));
    const V u = hn::Exp(d, hn::Max(hn::Mul(set(-0.5), hn::Mul(z, z)), set(-80.0)));
    const V pull = hn::Mul(t, set(1.0 / variance));
    const V mean[2] = {hn::MulAdd(pull, set(gx), set(cut.x_px)), hn::MulAdd(pull, set(gy), set(cut.y_px))};
    const Inside inside = InsideAt(cut, near, mean, hn::Add(offset, set(sweep.first_r_px))).Sums();
    const V unit = hn::Mul(u, set(cut.peak));
    hn::StoreU(hn::Mul(unit, inside.with_edges), d, columns + i);
    const V scaled = hn::Mul(unit, set(mode.weight));
    const V value = hn::Mul(scaled, inside.with_edges);
    const V by_centre = hn::Mul(value, hn::Mul(z, set(1.0 / sigma)));
    const V by_variance = hn::Mul(value, hn::Mul(hn::MulSub(z, z, set(1.0)), set(0.5 / variance)));
    for (int p = 0; p < 5; ++p) {
      // pull = (r - c.s) / variance moves with the centre and the variance.
      const V d_pull = hn::NegMulAdd(pull, set(d_variance[p] / variance), set(-d_centre[p] / variance));
      const V d_x = hn::MulAdd(pull, set(d_gx[p]), hn::MulAdd(d_pull, set(gx), set(p == 0 ? 1.0 : 0.0)));
      const V d_y = hn::MulAdd(pull, set(d_gy[p]), hn::MulAdd(d_pull, set(gy), set(p == 1 ? turn : 0.0)));
      const double by = d_variance[p] / (variance * variance);
      const double d_xx = (p == 2 ? 1.0 : 0.0) - 2.0 * gx / variance * d_gx[p] + gx * gx * by;
      const double d_xy = (p == 3 ? turn : 0.0) - (d_gx[p] * gy + gx * d_gy[p]) / variance + gx * gy * by;
      const double d_yy = (p == 4 ? 1.0 : 0.0) - 2.0 * gy / variance * d_gy[p] + gy * gy * by;
      V d_share = hn::MulAdd(inside.by_x, d_x, hn::Mul(inside.by_y, d_y));
      d_share = hn::MulAdd(inside.by_xx, set(d_xx), d_share);
      d_share = hn::MulAdd(inside.by_xy, set(d_xy), d_share);
      d_share = hn::MulAdd(inside.by_yy, set(d_yy), d_share);
      V sum = hn::Mul(by_centre, set(d_centre[p]));
      sum = hn::MulAdd(by_variance, set(d_variance[p]), sum);
      sum = hn::MulAdd(scaled, d_share, sum);
      hn::StoreU(sum, d, columns + static_cast<size_t>(p + 1) * stride + i);
    }
    hn::StoreU(hn::Sub(hn::LoadU(d, residual + i), value), d, residual + i);
  }
}

// The same by a sum over the pixels, for a narrow footprint that the edge clips.
void NarrowColumns(double weight, std::span<const ReachedPixel> pixels, const SampleLayout::Sweep& sweep,
                   const float* offset_px, float* residual, float* columns, size_t stride, Range range) {
  const D d;
  const auto set = [&](double v) { return hn::Set(d, static_cast<float>(v)); };
  const V inverse = set(1.0 / sweep.axis.sigma_px);
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
    const V offset = hn::LoadU(d, offset_px + i);
    V sum[6];
    std::fill(std::begin(sum), std::end(sum), hn::Zero(d));
    for (const ReachedPixel& pixel : pixels) {
      const double at = pixel.x_px * sweep.axis.cos_phi + pixel.y_px * sweep.axis.sin_phi - sweep.first_r_px;
      const V z = hn::Mul(hn::Sub(offset, set(at)), inverse);
      const V u = hn::Exp(d, hn::Max(hn::Mul(set(-0.5), hn::Mul(z, z)), set(-80.0)));
      const NormalShare& part = pixel.part;
      const double by[6] = {part.share,          weight * part.by_x,  weight * part.by_y,
                            weight * part.by_xx, weight * part.by_xy, weight * part.by_yy};
      for (size_t p = 0; p < 6; ++p) sum[p] = hn::MulAdd(set(by[p]), u, sum[p]);
    }
    for (size_t p = 0; p < 6; ++p) hn::StoreU(sum[p], d, columns + p * stride + i);
    hn::StoreU(hn::NegMulAdd(set(weight), sum[0], hn::LoadU(d, residual + i)), d, residual + i);
  }
}

// A mode that no edge clips, as stripes see it.
struct SeenMode {
  // `placed`: the mode at its true position; otherwise as stripes see it.
  SeenMode(const Footprint& mode, bool placed) {
    if (placed) {
      x = seen_through_pixels(mode.x_px, mode.xx_px2);
      y = seen_through_pixels(mode.y_px, mode.yy_px2);
    } else {
      x = {mode.x_px, mode.xx_px2, 1.0, 0.0, 0.0, 1.0};
      y = {mode.y_px, mode.yy_px2, 1.0, 0.0, 0.0, 1.0};
    }
    turn = x.centre_by_centre * y.centre_by_centre;
    seen = {.weight = mode.weight,
            .x_px = x.centre_px,
            .y_px = y.centre_px,
            .xx_px2 = x.variance_px2,
            .xy_px2 = mode.xy_px2 * turn,
            .yy_px2 = y.variance_px2};
  }

  SeenAxis x, y;
  double turn;  // of xy
  Footprint seen;
};

void WholeColumns(const SeenMode& whole, const SampleLayout::Sweep& sweep, const float* offset_px,
                  float* residual, float* columns, size_t stride, Range range) {
  const D d;
  const Footprint& mode = whole.seen;
  const SeenAxis &x = whole.x, &y = whole.y;
  const double c = sweep.axis.cos_phi, s = sweep.axis.sin_phi;
  const double variance = answered_variance(mode, sweep.axis), sigma = std::sqrt(variance);
  const double peak = sweep.axis.sigma_px / sigma, amplitude = mode.weight * peak;
  const double by_centre = amplitude / sigma, by_variance = 0.5 * amplitude / variance;
  const auto set = [&](double v) { return hn::Set(d, static_cast<float>(v)); };
  const V centre = set(mode.x_px * c + mode.y_px * s - sweep.first_r_px), inverse = set(1.0 / sigma);
  const V by_weight = set(peak), scale = set(amplitude);
  // Of x, y, xx, xy, yy: through c.s and sigma_r^2.
  const double centres[5] = {c * x.centre_by_centre, s * y.centre_by_centre, c * x.centre_by_variance, 0.0,
                             s * y.centre_by_variance};
  const double variances[5] = {c * c * x.variance_by_centre, s * s * y.variance_by_centre,
                               c * c * x.variance_by_variance, 2.0 * c * s * whole.turn,
                               s * s * y.variance_by_variance};
  V centre_part[5], variance_part[5];
  for (size_t p = 0; p < 5; ++p) {
    centre_part[p] = set(by_centre * centres[p]);
    variance_part[p] = set(by_variance * variances[p]);
  }
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
    const V z = hn::Mul(hn::Sub(hn::LoadU(d, offset_px + i), centre), inverse);
    const V zz = hn::Mul(z, z);
    const V u = hn::Exp(d, hn::Max(hn::Mul(set(-0.5), zz), set(-80.0)));
    const V zu = hn::Mul(z, u), wide = hn::MulSub(zz, u, u);
    hn::StoreU(hn::Mul(by_weight, u), d, columns + i);
    for (size_t p = 0; p < 5; ++p)
      hn::StoreU(hn::MulAdd(centre_part[p], zu, hn::Mul(variance_part[p], wide)), d,
                 columns + (p + 1) * stride + i);
    hn::StoreU(hn::NegMulAdd(scale, u, hn::LoadU(d, residual + i)), d, residual + i);
  }
}

double WeightedSquares(const float* w, const float* a, Range range) {
  const D d;
  V sum = hn::Zero(d);
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
    const V value = hn::LoadU(d, a + i);
    sum = hn::MulAdd(hn::Mul(hn::LoadU(d, w + i), value), value, sum);
  }
  return Total(sum);
}

double WeightedProduct(const float* w, const float* a, const float* b, Range range) {
  const D d;
  V sum = hn::Zero(d);
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d)))
    sum = hn::MulAdd(hn::Mul(hn::LoadU(d, w + i), hn::LoadU(d, a + i)), hn::LoadU(d, b + i), sum);
  return Total(sum);
}

// matrix[row + i][column + j] = sum w a_i b_j over three columns each, `stride` apart.
void ThreeByThree(const float* w, const float* a, const float* b, size_t stride,
                  std::span<const Range> ranges, int row, int column, NormalEquations& equations) {
  const D d;
  const float *a0 = a, *a1 = a + stride, *a2 = a1 + stride, *b0 = b, *b1 = b + stride, *b2 = b1 + stride;
  V s00 = hn::Zero(d), s01 = s00, s02 = s00, s10 = s00, s11 = s00, s12 = s00, s20 = s00, s21 = s00, s22 = s00;
  for (const Range range : ranges) {
    for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
      const V weight = hn::LoadU(d, w + i);
      const V x0 = hn::Mul(weight, hn::LoadU(d, a0 + i));
      const V x1 = hn::Mul(weight, hn::LoadU(d, a1 + i));
      const V x2 = hn::Mul(weight, hn::LoadU(d, a2 + i));
      const V y0 = hn::LoadU(d, b0 + i), y1 = hn::LoadU(d, b1 + i), y2 = hn::LoadU(d, b2 + i);
      s00 = hn::MulAdd(x0, y0, s00), s01 = hn::MulAdd(x0, y1, s01), s02 = hn::MulAdd(x0, y2, s02);
      s10 = hn::MulAdd(x1, y0, s10), s11 = hn::MulAdd(x1, y1, s11), s12 = hn::MulAdd(x1, y2, s12);
      s20 = hn::MulAdd(x2, y0, s20), s21 = hn::MulAdd(x2, y1, s21), s22 = hn::MulAdd(x2, y2, s22);
    }
  }
  const auto set = [&](int i, V x, V y, V z) {
    double* const m = &equations.matrix(column, row + i);  // of a symmetric matrix
    m[0] = Total(x), m[1] = Total(y), m[2] = Total(z);
  };
  set(0, s00, s01, s02), set(1, s10, s11, s12), set(2, s20, s21, s22);
}

void Gradient(const float* w, const float* residual, const float* a, size_t stride,
              std::span<const Range> ranges, double* gradient) {
  const D d;
  V s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0, s4 = s0, s5 = s0;
  for (const Range range : ranges) {
    for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
      const V r = hn::Mul(hn::LoadU(d, w + i), hn::LoadU(d, residual + i));
      const float* at = a + i;
      s0 = hn::MulAdd(r, hn::LoadU(d, at), s0), s1 = hn::MulAdd(r, hn::LoadU(d, at + stride), s1);
      s2 = hn::MulAdd(r, hn::LoadU(d, at + 2 * stride), s2),
      s3 = hn::MulAdd(r, hn::LoadU(d, at + 3 * stride), s3);
      s4 = hn::MulAdd(r, hn::LoadU(d, at + 4 * stride), s4),
      s5 = hn::MulAdd(r, hn::LoadU(d, at + 5 * stride), s5);
    }
  }
  gradient[0] = Total(s0), gradient[1] = Total(s1), gradient[2] = Total(s2);
  gradient[3] = Total(s3), gradient[4] = Total(s4), gradient[5] = Total(s5);
}

// Samples of the sweep within reach of the mode.
Range Reach(const Footprint& mode, const SampleLayout::Sweep& sweep, const float* offset_px) {
  const double centre = mode.x_px * sweep.axis.cos_phi + mode.y_px * sweep.axis.sin_phi - sweep.first_r_px;
  const double reach = kReach * std::sqrt(answered_variance(mode, sweep.axis));
  const float* end = offset_px + sweep.count;
  const auto first =
      static_cast<int>(std::lower_bound(offset_px, end, static_cast<float>(centre - reach)) - offset_px);
  const auto last =
      static_cast<int>(std::upper_bound(offset_px, end, static_cast<float>(centre + reach)) - offset_px);
  const int lanes = static_cast<int>(hn::Lanes(D()));
  const int begin = first / lanes * lanes;
  return {begin, last > first ? (last + lanes - 1) / lanes * lanes : begin};
}

// The squares of residuals within a range, in standard deviations, their number, and the products of
// neighbours.
void AddNear(const float* w, const float* residual, Range range, NormalEquations& equations) {
  const D d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const auto own_at = [&](int i) {
    return hn::Mul(hn::Sqrt(hn::LoadU(d, w + i)), hn::LoadU(d, residual + i));
  };
  const int lanes = static_cast<int>(hn::Lanes(d));
  V squares = zero, products = zero, counted = zero;
  float last = 0.0f;
  for (int i = range.begin; i < range.end; i += lanes) {
    const V own = own_at(i);
    squares = hn::MulAdd(own, own, squares);
    counted = hn::Add(counted, hn::IfThenElse(hn::Ne(hn::LoadU(d, w + i), zero), one, zero));
    HWY_ALIGN float before[SampleLayout::kPad + 1];
    before[0] = last;
    hn::StoreU(own, d, before + 1);
    products = hn::MulAdd(own, hn::LoadU(d, before), products);
    last = before[lanes];
  }
  equations.near_chi2 += Total(squares);
  equations.near_neighbours += Total(products);
  equations.near_count += static_cast<int>(Total(counted));
}

// Computes chi2 and its part within the modes' ranges.
void AddSquares(const float* w, const SampleLayout::Sweep& sweep, const float* residual,
                std::span<Range> ranges, NormalEquations& equations) {
  equations.cost += WeightedSquares(w, residual, {0, sweep.padded_count});
  for (size_t i = 1; i < ranges.size(); ++i) {
    for (size_t k = i; k > 0 && ranges[k].begin < ranges[k - 1].begin; --k)
      std::swap(ranges[k], ranges[k - 1]);
  }
  int done = 0;
  for (const Range range : ranges) {
    const Range rest{std::max(range.begin, done), range.end};
    if (rest.begin >= rest.end) continue;
    AddNear(w, residual, rest, equations);
    done = rest.end;
  }
}

constexpr size_t kMaxSweeps = 16;

// The sums of joint_fit.h at some footprints, but for those of areas and bounds.
class SumsAt {
 public:
  SumsAt(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
         JointWorkspace& workspace, NormalEquations& equations)
      : samples_(samples),
        layout_(*samples.layout),
        modes_(modes),
        extent_(extent),
        workspace_(workspace),
        equations_(equations),
        weight_(samples.weight.data()),
        stride_(samples.y.size()),
        sweep_count_(layout_.sweeps.size()),
        mode_count_(static_cast<size_t>(modes.size())) {}

  void Compute() {
    equations_.cost = equations_.near_chi2 = equations_.near_neighbours = equations_.floor = 0.0;
    equations_.near_count = 0;
    const auto size = static_cast<Eigen::Index>(6 * mode_count_);
    equations_.matrix.resize(size, size);
    equations_.gradient.resize(size);
    SubtractModes();
    if (!samples_.at_least.empty()) CountBounds();
    const double floors = std::isfinite(samples_.floor_weight) ? SubtractFloor() : 0.0;
    AddAllSquares();
    AddProducts();
    if (floors > 0.0) EliminateFloor(floors);
  }

 private:
  float* Columns(size_t m) const { return workspace_.columns.data() + 6 * m * stride_; }

  // Sets the residual and the columns of derivatives.
  void SubtractModes() {
    workspace_.residual.assign(samples_.y.begin(), samples_.y.end());
    workspace_.columns.resize(std::max(workspace_.columns.size(), 6 * mode_count_ * stride_));
    for (size_t m = 0; m < mode_count_; ++m) {
      const Footprint& mode = modes_[static_cast<int>(m)];
      const bool cut = near_edge(mode, extent_), by_pixels = cut && narrow(mode);
      std::vector<ReachedPixel> pixels;
      if (by_pixels) pixels = reached_pixels(mode, extent_);
      const SeenMode whole(mode, !cut && samples_.placed);
      for (size_t s = 0; s < sweep_count_; ++s) {
        const SampleLayout::Sweep& sweep = layout_.sweeps[s];
        const float* offset_px = layout_.offset_px.data() + sweep.first;
        float* const residual = workspace_.residual.data() + sweep.first;
        float* const columns = Columns(m) + sweep.first;
        const Range own = Reach(mode, sweep, offset_px);
        reach_[m][s] = {own.begin + sweep.first, own.end + sweep.first};
        if (!cut)
          WholeColumns(whole, sweep, offset_px, residual, columns, stride_, own);
        else if (by_pixels)
          NarrowColumns(mode.weight, pixels, sweep, offset_px, residual, columns, stride_, own);
        else
          CutColumns(mode, sweep, extent_, offset_px, residual, columns, stride_, own);
      }
    }
  }

  // Saturated samples count where the modes are below them.
  void CountBounds() {
    workspace_.weight.assign(samples_.weight.begin(), samples_.weight.end());
    for (size_t i = 0; i < stride_; ++i) {
      if (workspace_.residual[i] > 0.0f && samples_.at_least[i] > 0.0f)
        workspace_.weight[i] = samples_.at_least[i];
    }
    weight_ = workspace_.weight.data();
  }

  // Takes the best floor from the residual; returns U + w_f.
  double SubtractFloor() {
    const float *w = weight_, *u = samples_.floor_answer.data();
    const Range all{0, static_cast<int>(stride_)};
    double sum = WeightedProduct(w, u, workspace_.residual.data(), all);
    double floors = samples_.floor_weight + WeightedProduct(w, u, u, all);
    for (const AreaRow& row : workspace_.areas) {
      sum += row.weight * row.floor * row.rest;
      floors += row.weight * row.floor * row.floor;
    }
    equations_.floor = sum / floors;
    const auto floor = static_cast<float>(equations_.floor);
    for (size_t i = 0; i < stride_; ++i) workspace_.residual[i] -= floor * u[i];
    equations_.cost += samples_.floor_weight * equations_.floor * equations_.floor;
    return floors;
  }

  void AddAllSquares() {
    for (size_t s = 0; s < sweep_count_; ++s) {
      const SampleLayout::Sweep& sweep = layout_.sweeps[s];
      Range own[kMaxFootprints];
      for (size_t m = 0; m < mode_count_; ++m)
        own[m] = {reach_[m][s].begin - sweep.first, reach_[m][s].end - sweep.first};
      AddSquares(weight_ + sweep.first, sweep, workspace_.residual.data() + sweep.first, {own, mode_count_},
                 equations_);
    }
  }

  // The gradient and the matrix.
  void AddProducts() {
    const float* w = weight_;
    for (size_t m = 0; m < mode_count_; ++m) {
      Gradient(w, workspace_.residual.data(), Columns(m), stride_, {reach_[m], sweep_count_},
               equations_.gradient.data() + 6 * m);
      for (size_t n = m; n < mode_count_; ++n) {
        Range common[kMaxSweeps];
        for (size_t s = 0; s < sweep_count_; ++s) common[s] = Common(reach_[m][s], reach_[n][s]);
        for (size_t i = 0; i < 6; i += 3) {
          for (size_t j = m == n ? i : 0; j < 6; j += 3) {
            ThreeByThree(w, Columns(m) + i * stride_, Columns(n) + j * stride_, stride_,
                         {common, sweep_count_}, static_cast<int>(6 * m + i), static_cast<int>(6 * n + j),
                         equations_);
          }
        }
      }
    }
    for (Eigen::Index p = 0; p < equations_.matrix.rows(); ++p) {
      for (Eigen::Index q = 0; q < p / 3 * 3; ++q) equations_.matrix(q, p) = equations_.matrix(p, q);
    }
  }

  // N - n n'/(U + w_f)
  void EliminateFloor(double floors) {
    const float *w = weight_, *u = samples_.floor_answer.data();
    double by[kMaxParameters];  // n
    for (size_t m = 0; m < mode_count_; ++m) {
      for (size_t p = 6 * m; p < 6 * m + 6; ++p) {
        by[p] = 0.0;
        for (const AreaRow& row : workspace_.areas) by[p] += row.weight * row.floor * row.by[p];
        for (size_t s = 0; s < sweep_count_; ++s)
          by[p] += WeightedProduct(w, u, Columns(m) + (p - 6 * m) * stride_, reach_[m][s]);
      }
    }
    const Eigen::Map<const FootprintVector> n(by, equations_.matrix.rows());
    equations_.matrix.noalias() -= n * n.transpose() / floors;
  }

  const PixelSamples& samples_;
  const SampleLayout& layout_;
  const Footprints& modes_;
  const MonitorExtent& extent_;
  JointWorkspace& workspace_;
  NormalEquations& equations_;
  const float* weight_;  // of the samples that count
  const size_t stride_, sweep_count_, mode_count_;
  Range reach_[kMaxFootprints][kMaxSweeps];  // of the samples
};

void Evaluate(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
              JointWorkspace& workspace, NormalEquations& equations) {
  SumsAt(samples, modes, extent, workspace, equations).Compute();
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(Evaluate);

namespace {

void load_areas(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
                std::vector<AreaRow>& rows) {
  rows.clear();
  for (const AreaSample& sample : samples.areas)
    rows.push_back({.rest = sample.y, .floor = sample.floor_answer, .weight = sample.weight, .by = {}});
  if (rows.empty()) return;
  for (int m = 0; m < modes.size(); ++m) {
    const Footprint& mode = modes[m];
    LitShare shares(mode, extent);
    for (size_t i = 0; i < rows.size(); ++i) {
      AreaRow& row = rows[i];
      if (row.weight == 0.0) continue;
      const NormalShare own = shares.of(samples.areas[i].lit);
      row.rest -= mode.weight * own.share;
      double* by = row.by.data() + 6 * m;
      *by++ = own.share;
      for (const double slope : {own.by_x, own.by_y, own.by_xx, own.by_xy, own.by_yy})
        *by++ = mode.weight * slope;
    }
  }
}

void add_areas(const Footprints& modes, std::vector<AreaRow>& rows, NormalEquations& equations) {
  for (AreaRow& row : rows) {
    row.rest -= row.floor * equations.floor;
    if (row.weight == 0.0) continue;
    const double square = row.weight * row.rest * row.rest;
    equations.cost += square;
    equations.near_chi2 += square;
    ++equations.near_count;
    // Most bars do not depend on most parameters.
    std::array<int, kMaxParameters> told;
    size_t count = 0;
    for (int p = 0; p < 6 * modes.size(); ++p) {
      if (row.by[p] != 0.0) told[count++] = p;
    }
    for (size_t i = 0; i < count; ++i) {
      const double weighted = row.weight * row.by[told[i]];
      equations.gradient[told[i]] += weighted * row.rest;
      for (size_t j = 0; j < count; ++j) equations.matrix(told[j], told[i]) += weighted * row.by[told[j]];
    }
  }
}

void add_bounds(double weight, const Footprints& modes, NormalEquations& equations) {
  for (int m = 0; m < modes.size(); ++m) {
    const double beyond = modes[m].weight - 1.0;
    if (beyond <= 0.0) continue;
    const int p = 6 * m;
    equations.cost += weight * beyond * beyond;
    equations.gradient[p] -= weight * beyond;
    equations.matrix(p, p) += weight;
  }
}

// chi2 += w (1 - xx / u^2)^2 u^2 for widths below u, along each axis.
void add_widths(double weight, const Footprints& modes, NormalEquations& equations) {
  constexpr double kUsual_px2 = kUsualWidth_px * kUsualWidth_px;
  for (int m = 0; m < modes.size(); ++m) {
    for (const auto& [variance, i] : {std::pair{modes[m].xx_px2, 3}, {modes[m].yy_px2, 5}}) {
      const double below = 1.0 - variance / kUsual_px2;
      if (below <= 0.0) continue;
      const int p = 6 * m + i;
      equations.cost += weight * kUsual_px2 * below * below;
      equations.gradient[p] += weight * below;
      equations.matrix(p, p) += weight / kUsual_px2;
    }
  }
}

}  // namespace

void evaluate(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
              JointWorkspace& workspace, NormalEquations& equations) {
  load_areas(samples, modes, extent, workspace.areas);
  HWY_DYNAMIC_DISPATCH(Evaluate)(samples, modes, extent, workspace, equations);
  add_areas(modes, workspace.areas, equations);
  if (samples.bound_weight > 0.0) add_bounds(samples.bound_weight, modes, equations);
  if (samples.placed && samples.width_weight > 0.0) add_widths(samples.width_weight, modes, equations);
}

}  // namespace glasswing
#endif
