// The sums of joint_fit.h, vectors of samples at a time.
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

constexpr double kReach = 4.7;  // sigmas; beyond, a mode is below 2e-5 of its crest

// A mode as one sweep sees it: its basis columns on [begin, end) and how they turn into the derivatives by
// the six parameters.
struct SweepMode {
  bool cut = false;  // by the monitor's edge: six columns, the derivatives themselves
  int columns = 3;   // else three: u, z u, z^2 u
  int begin = 0, end = 0;
  const float* column[6] = {};
  double chain[3][6] = {};
};

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

// One side of inside(r): the part of a Gaussian (mean, sd) on [0, extent], and its derivatives by mean and
// variance.
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

// The six derivatives where the edge cuts the mode off; the model is taken from the residual on the way.
void CutColumns(const Footprint& mode, const SampleLayout::Sweep& sweep, const MonitorExtent& extent,
                const float* offset_px, float* residual, float* columns, int stride, const SweepMode& range) {
  const D d;
  const double c = sweep.axis.cos_phi, s = sweep.axis.sin_phi;
  const double variance = answered_variance(mode, sweep.axis), sigma = std::sqrt(variance);
  const double gx = c * mode.xx_px2 + s * mode.xy_px2, gy = c * mode.xy_px2 + s * mode.yy_px2;
  const double crest = sweep.axis.sigma_px / sigma;
  const double own_x = mode.xx_px2 - gx * gx / variance, own_y = mode.yy_px2 - gy * gy / variance;
  constexpr double kLeast_px2 = 1e-3;
  const auto sd_x = static_cast<float>(std::sqrt(std::max(own_x, kLeast_px2)));
  const auto sd_y = static_cast<float>(std::sqrt(std::max(own_y, kLeast_px2)));
  // By x, y, xx, xy, yy: of c.s, sigma_r^2, gx, gy, and of the lit part's own variances.
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
        static_cast<float>(extent.width_px), own_x <= kLeast_px2);
    const Side y = Within(
        hn::MulAdd(pull, hn::Set(d, static_cast<float>(gy)), hn::Set(d, static_cast<float>(mode.y_px))), sd_y,
        static_cast<float>(extent.height_px), own_y <= kLeast_px2);
    const V inside = hn::Mul(x.part, y.part);
    const V unit = hn::Mul(u, hn::Set(d, static_cast<float>(crest)));
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
      hn::StoreU(sum, d, columns + (p + 1) * stride + i);
    }
    hn::StoreU(hn::Sub(hn::LoadU(d, residual + i), value), d, residual + i);
  }
}

void WholeColumns(const Footprint& mode, const SampleLayout::Sweep& sweep, const float* offset_px,
                  float* residual, float* columns, int stride, SweepMode& range) {
  const D d;
  const double c = sweep.axis.cos_phi, s = sweep.axis.sin_phi;
  const double variance = answered_variance(mode, sweep.axis), sigma = std::sqrt(variance);
  const double crest = sweep.axis.sigma_px / sigma, amplitude = mode.weight * crest;
  const V centre = hn::Set(d, static_cast<float>(mode.x_px * c + mode.y_px * s - sweep.first_r_px));
  const V inverse = hn::Set(d, static_cast<float>(1.0 / sigma));
  const V scale = hn::Set(d, static_cast<float>(amplitude));
  for (int i = range.begin; i < range.end; i += static_cast<int>(hn::Lanes(d))) {
    const V z = hn::Mul(hn::Sub(hn::LoadU(d, offset_px + i), centre), inverse);
    const V zz = hn::Mul(z, z);
    const V u = hn::Exp(d, hn::Max(hn::Mul(hn::Set(d, -0.5f), zz), hn::Set(d, -80.0f)));
    hn::StoreU(u, d, columns + i);
    hn::StoreU(hn::Mul(z, u), d, columns + stride + i);
    hn::StoreU(hn::Mul(zz, u), d, columns + 2 * stride + i);
    hn::StoreU(hn::NegMulAdd(scale, u, hn::LoadU(d, residual + i)), d, residual + i);
  }
  const double by_centre = amplitude / sigma, by_variance = 0.5 * amplitude / variance;
  const double d_variance[6] = {0.0, 0.0, 0.0, c * c, 2.0 * c * s, s * s};
  range.chain[0][0] = crest;
  range.chain[1][1] = by_centre * c;
  range.chain[1][2] = by_centre * s;
  for (int p = 3; p < 6; ++p) {
    range.chain[0][p] = -by_variance * d_variance[p];
    range.chain[2][p] = by_variance * d_variance[p];
  }
}

// sums[a][b] = sum w a_column b_column, both with three columns.
void ThreeByThree(const float* w, const SweepMode& a, const SweepMode& b, int begin, int end,
                  double sums[6][6]) {
  const D d;
  V s00 = hn::Zero(d), s01 = s00, s02 = s00, s10 = s00, s11 = s00, s12 = s00, s20 = s00, s21 = s00, s22 = s00;
  for (int i = begin; i < end; i += static_cast<int>(hn::Lanes(d))) {
    const V weight = hn::LoadU(d, w + i);
    const V a0 = hn::Mul(weight, hn::LoadU(d, a.column[0] + i));
    const V a1 = hn::Mul(weight, hn::LoadU(d, a.column[1] + i));
    const V a2 = hn::Mul(weight, hn::LoadU(d, a.column[2] + i));
    const V b0 = hn::LoadU(d, b.column[0] + i), b1 = hn::LoadU(d, b.column[1] + i),
            b2 = hn::LoadU(d, b.column[2] + i);
    s00 = hn::MulAdd(a0, b0, s00), s01 = hn::MulAdd(a0, b1, s01), s02 = hn::MulAdd(a0, b2, s02);
    s10 = hn::MulAdd(a1, b0, s10), s11 = hn::MulAdd(a1, b1, s11), s12 = hn::MulAdd(a1, b2, s12);
    s20 = hn::MulAdd(a2, b0, s20), s21 = hn::MulAdd(a2, b1, s21), s22 = hn::MulAdd(a2, b2, s22);
  }
  sums[0][0] = Total(s00), sums[0][1] = Total(s01), sums[0][2] = Total(s02);
  sums[1][0] = Total(s10), sums[1][1] = Total(s11), sums[1][2] = Total(s12);
  sums[2][0] = Total(s20), sums[2][1] = Total(s21), sums[2][2] = Total(s22);
}

double WeightedProduct(const float* w, const float* a, const float* b, int begin, int end) {
  const D d;
  V sum = hn::Zero(d);
  for (int i = begin; i < end; i += static_cast<int>(hn::Lanes(d))) {
    sum = hn::MulAdd(hn::Mul(hn::LoadU(d, w + i), hn::LoadU(d, a + i)), hn::LoadU(d, b + i), sum);
  }
  return Total(sum);
}

double ChainAt(const SweepMode& mode, int column, int parameter) {
  return mode.cut ? (column == parameter ? 1.0 : 0.0) : mode.chain[column][parameter];
}

void AddPair(const float* w, const SweepMode& a, int place_a, const SweepMode& b, int place_b,
             NormalEquations& equations) {
  const int begin = std::max(a.begin, b.begin), end = std::min(a.end, b.end);
  if (begin >= end) return;
  double sums[6][6];
  if (!a.cut && !b.cut) {
    ThreeByThree(w, a, b, begin, end, sums);
  } else {
    for (int i = 0; i < a.columns; ++i) {
      for (int j = 0; j < b.columns; ++j)
        sums[i][j] = WeightedProduct(w, a.column[i], b.column[j], begin, end);
    }
  }
  double half[6][6];  // sums times b's chain
  for (int i = 0; i < a.columns; ++i) {
    for (int q = 0; q < 6; ++q) {
      double sum = 0.0;
      for (int j = 0; j < b.columns; ++j) sum += sums[i][j] * ChainAt(b, j, q);
      half[i][q] = sum;
    }
  }
  for (int p = 0; p < 6; ++p) {
    for (int q = 0; q < 6; ++q) {
      double sum = 0.0;
      for (int i = 0; i < a.columns; ++i) sum += ChainAt(a, i, p) * half[i][q];
      equations.matrix[static_cast<size_t>(6 * place_a + p)][static_cast<size_t>(6 * place_b + q)] += sum;
      if (place_a != place_b) {
        equations.matrix[static_cast<size_t>(6 * place_b + q)][static_cast<size_t>(6 * place_a + p)] += sum;
      }
    }
  }
}

void AddGradient(const float* w, const float* residual, const SweepMode& mode, int place,
                 NormalEquations& equations) {
  double sums[6];
  for (int i = 0; i < mode.columns; ++i) {
    sums[i] = WeightedProduct(w, mode.column[i], residual, mode.begin, mode.end);
  }
  for (int p = 0; p < 6; ++p) {
    double sum = 0.0;
    for (int i = 0; i < mode.columns; ++i) sum += ChainAt(mode, i, p) * sums[i];
    equations.gradient[static_cast<size_t>(6 * place + p)] += sum;
  }
}

// Samples within reach of the mode, as whole vectors.
void Reach(const Footprint& mode, const SampleLayout::Sweep& sweep, const float* offset_px,
           SweepMode& range) {
  const double centre = mode.x_px * sweep.axis.cos_phi + mode.y_px * sweep.axis.sin_phi - sweep.first_r_px;
  const double reach = kReach * std::sqrt(answered_variance(mode, sweep.axis));
  const float* end = offset_px + sweep.count;
  const auto first =
      static_cast<int>(std::lower_bound(offset_px, end, static_cast<float>(centre - reach)) - offset_px);
  const auto last =
      static_cast<int>(std::upper_bound(offset_px, end, static_cast<float>(centre + reach)) - offset_px);
  const int lanes = static_cast<int>(hn::Lanes(D()));
  range.begin = first / lanes * lanes;
  range.end = last > first ? (last + lanes - 1) / lanes * lanes : range.begin;
}

void AddSquares(const PixelSamples& samples, const SampleLayout::Sweep& sweep, const float* residual,
                std::span<const SweepMode> modes, NormalEquations& equations) {
  const float* w = samples.weight.data() + sweep.first;
  equations.chi2 += WeightedProduct(w, residual, residual, 0, sweep.padded_count);
  int begin[kMostFootprints], end[kMostFootprints], count = 0;
  for (const SweepMode& mode : modes) {
    if (mode.begin >= mode.end) continue;
    int at = count++;
    while (at > 0 && begin[at - 1] > mode.begin) begin[at] = begin[at - 1], end[at] = end[at - 1], --at;
    begin[at] = mode.begin, end[at] = mode.end;
  }
  int done = 0;
  for (int i = 0; i < count; ++i) {
    const int from = std::max(begin[i], done);
    if (from >= end[i]) continue;
    equations.near_chi2 += WeightedProduct(w, residual, residual, from, end[i]);
    equations.near_count += std::min(end[i], sweep.count) - from;
    done = end[i];
  }
}

void Evaluate(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
              JointWorkspace& workspace, NormalEquations& equations) {
  const SampleLayout& layout = *samples.layout;
  const D d;
  const int parameters = 6 * modes.size();
  equations.chi2 = equations.near_chi2 = 0.0;
  equations.near_count = 0;
  for (int p = 0; p < parameters; ++p) {
    equations.gradient[static_cast<size_t>(p)] = 0.0;
    std::fill_n(equations.matrix[static_cast<size_t>(p)].begin(), parameters, 0.0);
  }
  workspace.residual.resize(samples.y.size());
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    const size_t first = static_cast<size_t>(sweep.first);
    const int stride = sweep.padded_count;
    const size_t needed = static_cast<size_t>(stride) * 6 * kMostFootprints;
    if (workspace.columns.size() < needed) workspace.columns.resize(needed);
    const float* offset_px = layout.offset_px.data() + first;
    const float* w = samples.weight.data() + first;
    float* residual = workspace.residual.data() + first;
    std::copy_n(samples.y.data() + first, stride, residual);
    SweepMode seen[kMostFootprints];
    for (int m = 0; m < modes.size(); ++m) {
      SweepMode& mode = seen[m];
      float* columns = workspace.columns.data() + static_cast<size_t>(m) * 6 * static_cast<size_t>(stride);
      for (int i = 0; i < 6; ++i) mode.column[i] = columns + i * stride;
      Reach(modes[m], sweep, offset_px, mode);
      mode.cut = near_edge(modes[m], extent);
      mode.columns = mode.cut ? 6 : 3;
      if (mode.cut) {
        CutColumns(modes[m], sweep, extent, offset_px, residual, columns, stride, mode);
      } else {
        WholeColumns(modes[m], sweep, offset_px, residual, columns, stride, mode);
      }
    }
    for (int m = 0; m < modes.size(); ++m) {
      AddGradient(w, residual, seen[m], m, equations);
      for (int n = m; n < modes.size(); ++n) AddPair(w, seen[m], m, seen[n], n, equations);
    }
    AddSquares(samples, sweep, residual, {seen, static_cast<size_t>(modes.size())}, equations);
  }
  (void)d;
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
