#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/ramp/smoother/ramp_smoother_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>
//
#include <hwy/contrib/math/math-inl.h>

#include <cmath>
#include <cstddef>

#include "solver/ramp/smoother/ramp_smoother_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using internal::RefineStep;
using internal::SmoothStep;
using D = hn::CappedTag<float, SmoothArea::kMargin>;
using V = hn::Vec<D>;

constexpr float kDoubt = 6.0f;  // chi^2 from which a neighbour counts less; none at twice that
// The same for a coarse plane against the one it replaces, whose error is noisy.
constexpr float kCoarseDoubt = 9.0f;
constexpr float kRidge = 0.05f;  // px^2: keeps the slopes of windows that are a line or a point small
constexpr float kTiny = 1e-30f;
constexpr float kCells = 4.0f;  // pixels per coarse pixel

// The sums of one window's fit.
struct Sums {
  V weight, x, y, xx, xy, yy;  // of k I, and its moments of position
  V value[3], value_x[3], value_y[3];
  V kernel, kernel2;
};

// 1 / (v' + v widening), each v = 1 / info.
V Both(const V info, const V other, const V widening) {
  const V sum = hn::MulAdd(other, widening, hn::Add(info, hn::Set(D(), kTiny)));
  return hn::Mul(hn::Mul(info, other), hn::ApproximateReciprocal(sum));
}

V Agreement(const V chi2, float doubt) {
  const D d;
  const V left = hn::NegMulAdd(chi2, hn::Set(d, 1.0f / doubt), hn::Set(d, 2.0f));
  return hn::Min(hn::Set(d, 1.0f), hn::Max(hn::Zero(d), left));
}

// The previous step's state, ...
struct Estimates {
  const SmoothState& state;

  V value(int k, size_t at) const { return hn::LoadU(D(), &state.value[k][at]); }
  V across(int k, size_t at) const { return hn::LoadU(D(), &state.across[k][at]); }
  V down(int k, size_t at) const { return hn::LoadU(D(), &state.down[k][at]); }
  V info(size_t at) const { return hn::LoadU(D(), &state.info[at]); }
  V count(size_t at) const { return hn::LoadU(D(), &state.count[at]); }
  V tightness(size_t at) const { return hn::LoadU(D(), &state.tightness[at]); }
};

// ... or the samples, in the first step.
struct Raw {
  const SmoothSamples& samples;

  V value(int k, size_t at) const { return hn::LoadU(D(), &samples.value[k][at]); }
  V across(int /*k*/, size_t /*at*/) const { return hn::Zero(D()); }
  V down(int /*k*/, size_t /*at*/) const { return hn::Zero(D()); }
  V info(size_t at) const { return hn::LoadU(D(), &samples.info[at]); }
  V count(size_t at) const { return hn::IfThenElseZero(hn::Gt(info(at), hn::Zero(D())), hn::Set(D(), 1.0f)); }
  V tightness(size_t /*at*/) const { return hn::Zero(D()); }
};

// Lanes of pixels whose first is at `centre`.
template <typename Before>
Sums Gather(const SmoothStep& step, const Before& before, size_t centre) {
  const D d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const V rho_info = hn::Set(d, step.rho_info);
  const V info = before.info(centre), count = before.count(centre), tightness = before.tightness(centre);
  V value[3], across[3], down[3];
  for (int k = 0; k < 3; ++k) {
    value[k] = before.value(k, centre);
    across[k] = before.across(k, centre);
    down[k] = before.down(k, centre);
  }
  Sums sums{zero, zero, zero, zero, zero, zero, {zero, zero, zero}, {zero, zero, zero}, {zero, zero, zero},
            zero, zero};
  const int r = step.radius;
  const float reach = (static_cast<float>(r) + 0.5f) * (static_cast<float>(r) + 0.5f);
  const float fall = 1.0f / static_cast<float>((r + 1) * (r + 1));
  const std::ptrdiff_t stride = step.area.stride();
  for (int v = -r; v <= r; ++v) {
    const V below = hn::Set(d, static_cast<float>(v));
    V expected[3];  // for this row, in the pixel's own column
    for (int k = 0; k < 3; ++k) expected[k] = hn::MulAdd(down[k], below, value[k]);
    V weights = zero, x = zero, xx = zero, values[3] = {zero, zero, zero}, values_x[3] = {zero, zero, zero};
    for (int u = -r; u <= r; ++u) {
      const auto distance2 = static_cast<float>(u * u + v * v);
      if (distance2 > reach) continue;
      const size_t at = static_cast<std::ptrdiff_t>(centre) + v * stride + u;
      const V right = hn::Set(d, static_cast<float>(u));
      V off2[3];
      for (int k = 0; k < 3; ++k) {
        const V off = hn::NegMulAdd(across[k], right, hn::Sub(before.value(k, at), expected[k]));
        off2[k] = hn::Mul(off, off);
      }
      const V widening = hn::MulAdd(tightness, hn::Set(d, distance2), one);
      const V of_c = Both(info, before.info(at), widening);
      const V of_rho = Both(count, before.count(at), widening);
      const V chi2 = hn::MulAdd(hn::Add(off2[0], off2[1]), of_c, hn::Mul(off2[2], hn::Mul(of_rho, rho_info)));
      const V agreement = Agreement(chi2, kDoubt);
      const V sample_info = hn::LoadU(d, &step.samples->info[at]);
      const V kernel = hn::IfThenElseZero(hn::Gt(sample_info, zero),
                                          hn::Mul(agreement, hn::Set(d, 1.0f - distance2 * fall)));
      const V weight = hn::Mul(kernel, sample_info), weight_x = hn::Mul(weight, right);
      sums.kernel = hn::Add(sums.kernel, kernel);
      sums.kernel2 = hn::MulAdd(kernel, kernel, sums.kernel2);
      weights = hn::Add(weights, weight);
      x = hn::Add(x, weight_x);
      xx = hn::MulAdd(weight_x, right, xx);
      for (int k = 0; k < 3; ++k) {
        const V sample = hn::LoadU(d, &step.samples->value[k][at]);
        values[k] = hn::MulAdd(weight, sample, values[k]);
        values_x[k] = hn::MulAdd(weight_x, sample, values_x[k]);
      }
    }
    const V weights_y = hn::Mul(weights, below);
    sums.weight = hn::Add(sums.weight, weights);
    sums.x = hn::Add(sums.x, x);
    sums.y = hn::Add(sums.y, weights_y);
    sums.xx = hn::Add(sums.xx, xx);
    sums.xy = hn::MulAdd(x, below, sums.xy);
    sums.yy = hn::MulAdd(weights_y, below, sums.yy);
    for (int k = 0; k < 3; ++k) {
      sums.value[k] = hn::Add(sums.value[k], values[k]);
      sums.value_x[k] = hn::Add(sums.value_x[k], values_x[k]);
      sums.value_y[k] = hn::MulAdd(values[k], below, sums.value_y[k]);
    }
  }
  return sums;
}

// An estimate for each lane.
struct Fit {
  V value[3], across[3], down[3];
  V info, count, tightness;
};

// Without any informative sample the estimate is kept.
template <typename Before>
Fit Solve(const Sums& sums, const Before& before, size_t centre) {
  const D d;
  const V one = hn::Set(d, 1.0f), ridge = hn::Set(d, kRidge);
  const auto known = hn::Gt(sums.weight, hn::Zero(d));
  const V per_weight = hn::Div(one, hn::IfThenElse(known, sums.weight, one));
  const V mean_x = hn::Mul(sums.x, per_weight), mean_y = hn::Mul(sums.y, per_weight);
  const V xx = hn::Add(hn::NegMulAdd(mean_x, mean_x, hn::Mul(sums.xx, per_weight)), ridge);
  const V xy = hn::NegMulAdd(mean_x, mean_y, hn::Mul(sums.xy, per_weight));
  const V yy = hn::Add(hn::NegMulAdd(mean_y, mean_y, hn::Mul(sums.yy, per_weight)), ridge);
  const V per_det = hn::Div(one, hn::NegMulAdd(xy, xy, hn::Mul(xx, yy)));
  const auto choose = [&](const V value, const V old) { return hn::IfThenElse(known, value, old); };
  Fit fit;
  for (int k = 0; k < 3; ++k) {
    const V mean = hn::Mul(sums.value[k], per_weight);
    const V with_x = hn::NegMulAdd(mean, mean_x, hn::Mul(sums.value_x[k], per_weight));
    const V with_y = hn::NegMulAdd(mean, mean_y, hn::Mul(sums.value_y[k], per_weight));
    const V across = hn::Mul(hn::NegMulAdd(xy, with_y, hn::Mul(yy, with_x)), per_det);
    const V down = hn::Mul(hn::NegMulAdd(xy, with_x, hn::Mul(xx, with_y)), per_det);
    const V value = hn::NegMulAdd(down, mean_y, hn::NegMulAdd(across, mean_x, mean));
    fit.value[k] = choose(value, before.value(k, centre));
    fit.across[k] = choose(across, before.across(k, centre));
    fit.down[k] = choose(down, before.down(k, centre));
  }
  // The fit's variance at the pixel, in units of that of the window's mean.
  const V lever = hn::Mul(per_det, hn::MulAdd(hn::Mul(mean_x, mean_x), yy,
                                              hn::NegMulAdd(hn::Add(xy, xy), hn::Mul(mean_x, mean_y),
                                                            hn::Mul(hn::Mul(mean_y, mean_y), xx))));
  const V per_kernel2 = hn::Div(one, hn::IfThenElse(known, sums.kernel2, one));
  const V per_lever = hn::Div(one, hn::Add(lever, one));
  const V kernel_count = hn::Mul(sums.kernel, hn::Mul(per_kernel2, per_lever));
  fit.info = choose(hn::Mul(kernel_count, sums.weight), before.info(centre));
  fit.count = choose(hn::Mul(kernel_count, sums.kernel), before.count(centre));
  fit.tightness = choose(hn::Div(hn::Set(d, 2.0f), hn::Add(xx, yy)), before.tightness(centre));
  return fit;
}

void Store(const Fit& fit, size_t at, SmoothState& state) {
  const D d;
  for (int k = 0; k < 3; ++k) {
    hn::StoreU(fit.value[k], d, &state.value[k][at]);
    hn::StoreU(fit.across[k], d, &state.across[k][at]);
    hn::StoreU(fit.down[k], d, &state.down[k][at]);
  }
  hn::StoreU(fit.info, d, &state.info[at]);
  hn::StoreU(fit.count, d, &state.count[at]);
  hn::StoreU(fit.tightness, d, &state.tightness[at]);
}

template <typename Before>
void SmoothFrom(const Before& before, const SmoothStep& step, int first, int last) {
  const D d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int y = first; y < last; ++y) {
    for (int x = 0; x < step.area.width; x += lanes) {
      const size_t centre = step.area.at(x, y);
      if (!hn::AllFalse(d, hn::Gt(hn::LoadU(d, &step.samples->object[centre]), hn::Zero(d))))
        Store(Solve(Gather(step, before, centre), before, centre), centre, *step.after);
    }
  }
}

void SmoothRows(const SmoothStep& step, int first, int last) {
  if (step.before != nullptr) {
    SmoothFrom(Estimates{*step.before}, step, first, last);
  } else {
    SmoothFrom(Raw{*step.samples}, step, first, last);
  }
}

// The estimate of a window at full resolution.
struct Narrow {
  V value[3], info, count;
};

// A row's pixels at even and odd positions.
void Split(const V low, const V high, V& even, V& odd) {
  const D d;
  float row[2 * SmoothArea::kMargin];
  hn::StoreU(low, d, row);
  hn::StoreU(high, d, row + hn::Lanes(d));
  hn::LoadInterleaved2(d, row, even, odd);
}
void Split(const Fit& low, const Fit& high, Narrow& even, Narrow& odd) {
  for (int k = 0; k < 3; ++k) Split(low.value[k], high.value[k], even.value[k], odd.value[k]);
  Split(low.info, high.info, even.info, odd.info);
  Split(low.count, high.count, even.count, odd.count);
}

// The planes of coarse pixels that agree with `narrow` replace it. The nearest is `centre`, a quarter of a
// coarse pixel away; `right` and `below` say on which side, 1 or -1.
void TakeCoarse(const RefineStep& step, size_t centre, int right, int below, Narrow& narrow) {
  const D d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), tiny = hn::Set(d, kTiny);
  const SmoothState& coarse = *step.coarse;
  V weights = zero, most = zero, infos = zero, sums[3] = {zero, zero, zero};
  for (const int v : {0, below}) {
    for (const int u : {0, right}) {
      const size_t at = static_cast<std::ptrdiff_t>(centre) +
                        v * static_cast<std::ptrdiff_t>(step.coarse_area.stride()) + u;
      const float x = 0.25f * static_cast<float>(right) - static_cast<float>(u),
                  y = 0.25f * static_cast<float>(below) - static_cast<float>(v);
      V value[3], off2[3];
      for (int k = 0; k < 3; ++k) {
        value[k] = hn::MulAdd(
            hn::LoadU(d, &coarse.across[k][at]), hn::Set(d, x),
            hn::MulAdd(hn::LoadU(d, &coarse.down[k][at]), hn::Set(d, y), hn::LoadU(d, &coarse.value[k][at])));
        const V off = hn::Sub(value[k], narrow.value[k]);
        off2[k] = hn::Mul(off, off);
      }
      const V info = hn::LoadU(d, &coarse.info[at]);
      const V count = hn::Mul(hn::LoadU(d, &coarse.count[at]), hn::Set(d, kCells));
      const V widening = hn::MulAdd(hn::LoadU(d, &coarse.tightness[at]), hn::Set(d, x * x + y * y), one);
      const V chi2 = hn::MulAdd(
          hn::Add(off2[0], off2[1]), Both(info, narrow.info, widening),
          hn::Mul(off2[2], hn::Mul(Both(count, narrow.count, widening), hn::Set(d, step.fine.rho_info))));
      const V agreement = hn::IfThenElseZero(hn::Gt(info, zero), Agreement(chi2, kCoarseDoubt));
      // Among several candidates the likelier one.
      const V likelihood = hn::Exp(d, hn::Mul(chi2, hn::Set(d, -0.5f)));
      const V weight = hn::Mul(hn::IfThenElseZero(hn::Gt(agreement, zero), likelihood),
                               hn::Set(d, (1.0f - std::abs(x)) * (1.0f - std::abs(y))));
      most = hn::Max(most, agreement);
      weights = hn::Add(weights, weight);
      infos = hn::MulAdd(weight, info, infos);
      for (int k = 0; k < 3; ++k) sums[k] = hn::MulAdd(weight, value[k], sums[k]);
    }
  }
  const V share = hn::Div(most, hn::Max(weights, tiny));
  const V rest = hn::Sub(one, most);
  for (int k = 0; k < 3; ++k) narrow.value[k] = hn::MulAdd(rest, narrow.value[k], hn::Mul(share, sums[k]));
  narrow.info = hn::MulAdd(rest, narrow.info, hn::Mul(share, infos));
}

void RefineRows(const RefineStep& step, int first, int last) {
  const D d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  const SmoothStep& fine = step.fine;
  const Estimates before{*fine.before};
  for (int y = first; y < last; ++y) {
    const int row = fine.area.y0 + y, below = row % 2 == 0 ? -1 : 1;
    for (int x = 0; x < fine.area.width; x += 2 * lanes) {
      const size_t low = fine.area.at(x, y), high = low + static_cast<size_t>(lanes);
      const auto on = [&](size_t at) { return hn::LoadU(d, &fine.samples->object[at]); };
      if (hn::AllFalse(d, hn::Gt(hn::Add(on(low), on(high)), hn::Zero(d)))) continue;
      const Fit left = Solve(Gather(fine, before, low), before, low);
      const Fit right = Solve(Gather(fine, before, high), before, high);
      Narrow even, odd;
      Split(left, right, even, odd);
      const size_t coarse = step.coarse_area.at(x / 2, row / 2 - step.coarse_area.y0);
      TakeCoarse(step, coarse, -1, below, even);
      TakeCoarse(step, coarse, 1, below, odd);
      for (int k = 0; k < 3; ++k)
        hn::StoreInterleaved2(even.value[k], odd.value[k], d, &fine.after->value[k][low]);
      hn::StoreInterleaved2(even.info, odd.info, d, &fine.after->info[low]);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(SmoothRows);
HWY_EXPORT(RefineRows);

void internal::smooth_rows(const SmoothStep& step, int first, int last) {
  HWY_DYNAMIC_DISPATCH(SmoothRows)(step, first, last);
}

void internal::refine_rows(const RefineStep& step, int first, int last) {
  HWY_DYNAMIC_DISPATCH(RefineRows)(step, first, last);
}

}  // namespace glasswing
#endif
