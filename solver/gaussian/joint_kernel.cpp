// The sums of joint_fit.h, a vector of samples at a time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/joint_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "solver/gaussian/joint_fit.h"

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

// Phi(a), and phi(a) beside it. Abramowitz and Stegun 7.1.26: |error| < 1.5e-7.
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

// One side of inside(r): the share of a Gaussian (mean, sd) on [0, extent], and its derivatives with respect
// to mean and variance.
struct Side {
  V part, by_mean, by_variance;
};

Side Within(V mean, float sd, float extent, bool clamped) {
  const D d;
  const V inverse = hn::Set(d, 1.0f / sd);
  const V high = hn::Mul(hn::Sub(hn::Set(d, extent), mean), inverse);
  const V low = hn::Neg(hn::Mul(mean, inverse));
  V high_density, low_density;
  const V high_part = NormalIntegral(high, &high_density), low_part = NormalIntegral(low, &low_density);
  Side side;
  side.part = hn::Sub(high_part, low_part);
  side.by_mean = hn::Mul(hn::Sub(low_density, high_density), inverse);
  side.by_variance = clamped ? hn::Zero(d)
                             : hn::Mul(hn::Sub(hn::Mul(low, low_density), hn::Mul(high, high_density)),
                                       hn::Set(d, 0.5f / (sd * sd)));
  return side;
}

// The six derivatives if the edge cuts the mode off; also subtracts the model from the residual.
void CutColumns(const Footprint& mode, const SampleLayout::Sweep& sweep, const MonitorExtent& extent,
                const float* offset_px, float* residual, float* columns, size_t stride, Range range) {
  const D d;
  const double c = sweep.axis.cos_phi, s = sweep.axis.sin_phi;
  const double variance = answered_variance(mode, sweep.axis), sigma = std::sqrt(variance);
  const double gx = c * mode.xx_px2 + s * mode.xy_px2, gy = c * mode.xy_px2 + s * mode.yy_px2;
  const double peak = sweep.axis.sigma_px / sigma;
  const double own_x = mode.xx_px2 - gx * gx / variance, own_y = mode.yy_px2 - gy * gy / variance;
  constexpr double kMin_px2 = 1e-3;
  const auto sd_x = static_cast<float>(std::sqrt(std::max(own_x, kMin_px2)));
  const auto sd_y = static_cast<float>(std::sqrt(std::max(own_y, kMin_px2)));
  // Derivatives by x, y, xx, xy, yy: of c.s, sigma_r^2, gx, gy, and of the lit part's own variances.
  const double d_centre[5] = {c, s, 0.0, 0.0, 0.0};
  const double d_variance[5] = {0.0, 0.0, c * c, 2.0 * c * s, s * s};
  const double d_gx[5] = {0.0, 0.0, c, s, 0.0};
  const double d_gy[5] = {0.0, 0.0, 0.0, c, s};
  const V centre = hn::Set(d, static_cast<float>(mode.x_px * c + mode.y_px * s - sweep.first_r_px));
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
    const V t = hn::Sub(hn::LoadU(d, offset_px + i), centre);
    const V z = hn::Mul(t, hn::Set(d, static_cast<float>(1.0 / sigma)));
    const V u = hn::Exp(d, hn::Max(hn::Mul(hn::Set(d, -0.5f), hn::Mul(z, z)), hn::Set(d, -80.0f)));
    const V pull = hn::Mul(t, hn::Set(d, static_cast<float>(1.0 / variance)));
    const Side x = Within(
        hn::MulAdd(pull, hn::Set(d, static_cast<float>(gx)), hn::Set(d, static_cast<float>(mode.x_px))), sd_x,
        static_cast<float>(extent.width_px), own_x <= kMin_px2);
    const Side y = Within(
        hn::MulAdd(pull, hn::Set(d, static_cast<float>(gy)), hn::Set(d, static_cast<float>(mode.y_px))), sd_y,
        static_cast<float>(extent.height_px), own_y <= kMin_px2);
    const V inside = hn::Mul(x.part, y.part);
    const V unit = hn::Mul(u, hn::Set(d, static_cast<float>(peak)));
    const V by_weight = hn::Mul(unit, inside);
    hn::StoreU(by_weight, d, columns + i);
    const V scaled = hn::Mul(unit, hn::Set(d, static_cast<float>(mode.weight)));
    const V value = hn::Mul(scaled, inside);
    const V by_centre = hn::Mul(value, hn::Mul(z, hn::Set(d, static_cast<float>(1.0 / sigma))));
    const V by_variance = hn::Mul(
        value, hn::Mul(hn::MulSub(z, z, hn::Set(d, 1.0f)), hn::Set(d, static_cast<float>(0.5 / variance))));
    for (int p = 0; p < 5; ++p) {
      const auto set = [&](double v) { return hn::Set(d, static_cast<float>(v)); };
      // pull = (r - c.s) / variance moves with the centre and the variance.
      const V d_pull = hn::NegMulAdd(pull, set(d_variance[p] / variance), set(-d_centre[p] / variance));
      const V d_mean_x = hn::MulAdd(pull, set(d_gx[p]), hn::MulAdd(d_pull, set(gx), set(p == 0 ? 1.0 : 0.0)));
      const V d_mean_y = hn::MulAdd(pull, set(d_gy[p]), hn::MulAdd(d_pull, set(gy), set(p == 1 ? 1.0 : 0.0)));
      const double d_own_x = (p == 2 ? 1.0 : 0.0) - 2.0 * gx / variance * d_gx[p] +
                             gx * gx / (variance * variance) * d_variance[p];
      const double d_own_y = (p == 4 ? 1.0 : 0.0) - 2.0 * gy / variance * d_gy[p] +
                             gy * gy / (variance * variance) * d_variance[p];
      const V d_x = hn::MulAdd(x.by_mean, d_mean_x, hn::Mul(x.by_variance, set(d_own_x)));
      const V d_y = hn::MulAdd(y.by_mean, d_mean_y, hn::Mul(y.by_variance, set(d_own_y)));
      V sum = hn::Mul(by_centre, set(d_centre[p]));
      sum = hn::MulAdd(by_variance, set(d_variance[p]), sum);
      sum = hn::MulAdd(scaled, hn::MulAdd(y.part, d_x, hn::Mul(x.part, d_y)), sum);
      hn::StoreU(sum, d, columns + static_cast<size_t>(p + 1) * stride + i);
    }
    hn::StoreU(hn::Sub(hn::LoadU(d, residual + i), value), d, residual + i);
  }
}

void WholeColumns(const Footprint& mode, const SampleLayout::Sweep& sweep, const MonitorExtent&,
                  const float* offset_px, float* residual, float* columns, size_t stride, Range range) {
  const D d;
  const double c = sweep.axis.cos_phi, s = sweep.axis.sin_phi;
  const double variance = answered_variance(mode, sweep.axis), sigma = std::sqrt(variance);
  const double peak = sweep.axis.sigma_px / sigma, amplitude = mode.weight * peak;
  const double by_centre = amplitude / sigma, by_variance = 0.5 * amplitude / variance;
  const auto set = [&](double v) { return hn::Set(d, static_cast<float>(v)); };
  const V centre = set(mode.x_px * c + mode.y_px * s - sweep.first_r_px), inverse = set(1.0 / sigma);
  const V by_weight = set(peak), by_x = set(by_centre * c), by_y = set(by_centre * s), scale = set(amplitude);
  const V by_xx = set(by_variance * c * c), by_xy = set(by_variance * 2.0 * c * s),
          by_yy = set(by_variance * s * s);
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
    const V z = hn::Mul(hn::Sub(hn::LoadU(d, offset_px + i), centre), inverse);
    const V zz = hn::Mul(z, z);
    const V u = hn::Exp(d, hn::Max(hn::Mul(set(-0.5), zz), set(-80.0)));
    const V zu = hn::Mul(z, u), wide = hn::MulSub(zz, u, u);
    hn::StoreU(hn::Mul(by_weight, u), d, columns + i);
    hn::StoreU(hn::Mul(by_x, zu), d, columns + stride + i);
    hn::StoreU(hn::Mul(by_y, zu), d, columns + 2 * stride + i);
    hn::StoreU(hn::Mul(by_xx, wide), d, columns + 3 * stride + i);
    hn::StoreU(hn::Mul(by_xy, wide), d, columns + 4 * stride + i);
    hn::StoreU(hn::Mul(by_yy, wide), d, columns + 5 * stride + i);
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
  double* m = &equations.matrix[static_cast<size_t>(row)][static_cast<size_t>(column)];
  m[0] = Total(s00), m[1] = Total(s01), m[2] = Total(s02);
  m += kMaxParameters;
  m[0] = Total(s10), m[1] = Total(s11), m[2] = Total(s12);
  m += kMaxParameters;
  m[0] = Total(s20), m[1] = Total(s21), m[2] = Total(s22);
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

// Computes chi2 and its part within the modes' ranges.
void AddSquares(const PixelSamples& samples, const SampleLayout::Sweep& sweep, const float* residual,
                std::span<Range> ranges, NormalEquations& equations) {
  const float* w = samples.weight.data() + sweep.first;
  equations.chi2 += WeightedSquares(w, residual, {0, sweep.padded_count});
  for (size_t i = 1; i < ranges.size(); ++i) {
    for (size_t k = i; k > 0 && ranges[k].begin < ranges[k - 1].begin; --k)
      std::swap(ranges[k], ranges[k - 1]);
  }
  int done = 0;
  for (const Range range : ranges) {
    const Range rest{std::max(range.begin, done), range.end};
    if (rest.begin >= rest.end) continue;
    double before = 0.0;
    equations.near_chi2 += WeightedSquares(w, residual, rest);
    for (int i = rest.begin; i < std::min(rest.end, sweep.count); ++i) {
      if (w[i] == 0.0f) continue;
      ++equations.near_count;
      const double own = static_cast<double>(std::sqrt(w[i]) * residual[i]);
      equations.near_neighbours += own * before;
      before = own;
    }
    done = rest.end;
  }
}

void Evaluate(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
              JointWorkspace& workspace, NormalEquations& equations) {
  constexpr size_t kMaxSweeps = 16;
  const SampleLayout& layout = *samples.layout;
  const size_t stride = samples.y.size(), sweep_count = layout.sweeps.size();
  const auto mode_count = static_cast<size_t>(modes.size());
  equations.chi2 = equations.near_chi2 = equations.near_neighbours = 0.0;
  equations.near_count = 0;
  workspace.residual.assign(samples.y.begin(), samples.y.end());
  if (workspace.columns.size() < 6 * mode_count * stride) workspace.columns.resize(6 * mode_count * stride);
  const auto columns_of = [&](size_t m) { return workspace.columns.data() + 6 * m * stride; };
  Range reach[kMaxFootprints][kMaxSweeps];
  for (size_t s = 0; s < sweep_count; ++s) {
    const SampleLayout::Sweep& sweep = layout.sweeps[s];
    const float* offset_px = layout.offset_px.data() + sweep.first;
    float* residual = workspace.residual.data() + sweep.first;
    Range own[kMaxFootprints];
    for (size_t m = 0; m < mode_count; ++m) {
      const Footprint& mode = modes[static_cast<int>(m)];
      own[m] = Reach(mode, sweep, offset_px);
      reach[m][s] = {own[m].begin + sweep.first, own[m].end + sweep.first};
      const auto make = near_edge(mode, extent) ? CutColumns : WholeColumns;
      make(mode, sweep, extent, offset_px, residual, columns_of(m) + sweep.first, stride, own[m]);
    }
    AddSquares(samples, sweep, residual, {own, mode_count}, equations);
  }
  const float* w = samples.weight.data();
  for (size_t m = 0; m < mode_count; ++m) {
    Gradient(w, workspace.residual.data(), columns_of(m), stride, {reach[m], sweep_count},
             &equations.gradient[6 * m]);
    for (size_t n = m; n < mode_count; ++n) {
      Range common[kMaxSweeps];
      for (size_t s = 0; s < sweep_count; ++s) common[s] = Common(reach[m][s], reach[n][s]);
      for (size_t i = 0; i < 6; i += 3) {
        for (size_t j = m == n ? i : 0; j < 6; j += 3) {
          ThreeByThree(w, columns_of(m) + i * stride, columns_of(n) + j * stride, stride,
                       {common, sweep_count}, static_cast<int>(6 * m + i), static_cast<int>(6 * n + j),
                       equations);
        }
      }
    }
  }
  for (size_t p = 0; p < 6 * mode_count; ++p) {
    for (size_t q = 0; q < p / 3 * 3; ++q) equations.matrix[p][q] = equations.matrix[q][p];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(Evaluate);

void evaluate(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
              JointWorkspace& workspace, NormalEquations& equations) {
  HWY_DYNAMIC_DISPATCH(Evaluate)(samples, modes, extent, workspace, equations);
}

}  // namespace glasswing
#endif
