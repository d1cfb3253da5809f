#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/ramp/ramp_smoother_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include <cstddef>

#include "solver/ramp/ramp_smoother_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using internal::SmoothStep;
using D = hn::CappedTag<float, SmoothArea::kMargin>;
using V = hn::Vec<D>;

constexpr float kDoubt = 6.0f;   // chi^2 from which a neighbour counts less; none at twice that
constexpr float kRidge = 0.05f;  // px^2: steps of windows that are but a line or a point stay small
constexpr float kTiny = 1e-30f;

// The sums of one window's fit.
struct Sums {
  V weight, x, y, xx, xy, yy;  // of k I, and with the place
  V value[3], value_x[3], value_y[3];
  V kernel, kernel2;
};

// Lanes of pixels whose first is at `centre`.
Sums Gather(const SmoothStep& step, size_t centre) {
  const D d;
  const SmoothState& before = *step.before;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), tiny = hn::Set(d, kTiny);
  const V rho_info = hn::Set(d, step.rho_info);
  const V info = hn::LoadU(d, &before.info[centre]);
  const V count = hn::LoadU(d, &before.count[centre]);
  const V tightness = hn::LoadU(d, &before.tightness[centre]);
  V value[3], across[3], down[3];
  for (int k = 0; k < 3; ++k) {
    value[k] = hn::LoadU(d, &before.value[k][centre]);
    across[k] = hn::LoadU(d, &before.across[k][centre]);
    down[k] = hn::LoadU(d, &before.down[k][centre]);
  }
  Sums sums{zero, zero, zero, zero, zero, zero, {zero, zero, zero}, {zero, zero, zero}, {zero, zero, zero},
            zero, zero};
  const int r = step.radius;
  const float reach = (static_cast<float>(r) + 0.5f) * (static_cast<float>(r) + 0.5f);
  const float fall = 1.0f / static_cast<float>((r + 1) * (r + 1));
  const auto stride = static_cast<std::ptrdiff_t>(step.area.stride());
  for (int v = -r; v <= r; ++v) {
    for (int u = -r; u <= r; ++u) {
      const auto distance2 = static_cast<float>(u * u + v * v);
      if (distance2 > reach) continue;
      const auto at = static_cast<size_t>(static_cast<std::ptrdiff_t>(centre) + v * stride + u);
      const V right = hn::Set(d, static_cast<float>(u)), below = hn::Set(d, static_cast<float>(v));
      V off2[3];
      for (int k = 0; k < 3; ++k) {
        const V there = hn::LoadU(d, &before.value[k][at]);
        const V off =
            hn::Sub(hn::Sub(there, value[k]), hn::MulAdd(across[k], right, hn::Mul(down[k], below)));
        off2[k] = hn::Mul(off, off);
      }
      const V widening = hn::MulAdd(tightness, hn::Set(d, distance2), one);
      const V info_there = hn::LoadU(d, &before.info[at]), count_there = hn::LoadU(d, &before.count[at]);
      // 1 / (v_j + v_i widening), each v = 1 / info
      const V of_c =
          hn::Mul(hn::Mul(info, info_there),
                  hn::ApproximateReciprocal(hn::MulAdd(info_there, widening, hn::Add(info, tiny))));
      const V of_rho =
          hn::Mul(hn::Mul(count, count_there),
                  hn::ApproximateReciprocal(hn::MulAdd(count_there, widening, hn::Add(count, tiny))));
      const V chi2 = hn::MulAdd(hn::Add(off2[0], off2[1]), of_c, hn::Mul(off2[2], hn::Mul(of_rho, rho_info)));
      const V agreement =
          hn::Min(one, hn::Max(zero, hn::NegMulAdd(chi2, hn::Set(d, 1.0f / kDoubt), hn::Set(d, 2.0f))));
      const V sample_info = hn::LoadU(d, &step.samples->info[at]);
      const V kernel = hn::IfThenElseZero(hn::Gt(sample_info, zero),
                                          hn::Mul(agreement, hn::Set(d, 1.0f - distance2 * fall)));
      const V weight = hn::Mul(kernel, sample_info);
      const V weight_x = hn::Mul(weight, right), weight_y = hn::Mul(weight, below);
      sums.kernel = hn::Add(sums.kernel, kernel);
      sums.kernel2 = hn::MulAdd(kernel, kernel, sums.kernel2);
      sums.weight = hn::Add(sums.weight, weight);
      sums.x = hn::Add(sums.x, weight_x);
      sums.y = hn::Add(sums.y, weight_y);
      sums.xx = hn::MulAdd(weight_x, right, sums.xx);
      sums.xy = hn::MulAdd(weight_x, below, sums.xy);
      sums.yy = hn::MulAdd(weight_y, below, sums.yy);
      for (int k = 0; k < 3; ++k) {
        const V sample = hn::LoadU(d, &step.samples->value[k][at]);
        sums.value[k] = hn::MulAdd(weight, sample, sums.value[k]);
        sums.value_x[k] = hn::MulAdd(weight_x, sample, sums.value_x[k]);
        sums.value_y[k] = hn::MulAdd(weight_y, sample, sums.value_y[k]);
      }
    }
  }
  return sums;
}

// Where no sample says anything the estimate stays.
void Solve(const Sums& sums, const SmoothStep& step, size_t centre) {
  const D d;
  const V one = hn::Set(d, 1.0f), ridge = hn::Set(d, kRidge);
  const auto known = hn::Gt(sums.weight, hn::Zero(d));
  const V per_weight = hn::Div(one, hn::IfThenElse(known, sums.weight, one));
  const V mean_x = hn::Mul(sums.x, per_weight), mean_y = hn::Mul(sums.y, per_weight);
  const V xx = hn::Add(hn::NegMulAdd(mean_x, mean_x, hn::Mul(sums.xx, per_weight)), ridge);
  const V xy = hn::NegMulAdd(mean_x, mean_y, hn::Mul(sums.xy, per_weight));
  const V yy = hn::Add(hn::NegMulAdd(mean_y, mean_y, hn::Mul(sums.yy, per_weight)), ridge);
  const V per_det = hn::Div(one, hn::NegMulAdd(xy, xy, hn::Mul(xx, yy)));
  const auto keep = [&](const V value, const Plane& before, Plane& after) {
    hn::StoreU(hn::IfThenElse(known, value, hn::LoadU(d, &before[centre])), d, &after[centre]);
  };
  for (int k = 0; k < 3; ++k) {
    const V mean = hn::Mul(sums.value[k], per_weight);
    const V with_x = hn::NegMulAdd(mean, mean_x, hn::Mul(sums.value_x[k], per_weight));
    const V with_y = hn::NegMulAdd(mean, mean_y, hn::Mul(sums.value_y[k], per_weight));
    const V across = hn::Mul(hn::NegMulAdd(xy, with_y, hn::Mul(yy, with_x)), per_det);
    const V down = hn::Mul(hn::NegMulAdd(xy, with_x, hn::Mul(xx, with_y)), per_det);
    const V value = hn::NegMulAdd(down, mean_y, hn::NegMulAdd(across, mean_x, mean));
    keep(value, step.before->value[k], step.after->value[k]);
    keep(across, step.before->across[k], step.after->across[k]);
    keep(down, step.before->down[k], step.after->down[k]);
  }
  // The fit's variance at the pixel, in units of that of the window's mean.
  const V lever = hn::Mul(per_det, hn::MulAdd(hn::Mul(mean_x, mean_x), yy,
                                              hn::NegMulAdd(hn::Add(xy, xy), hn::Mul(mean_x, mean_y),
                                                            hn::Mul(hn::Mul(mean_y, mean_y), xx))));
  const V per_kernel2 = hn::Div(one, hn::IfThenElse(known, sums.kernel2, one));
  const V per_lever = hn::Div(one, hn::Add(lever, one));
  const V kernel_count = hn::Mul(sums.kernel, hn::Mul(per_kernel2, per_lever));
  keep(hn::Mul(kernel_count, sums.weight), step.before->info, step.after->info);
  keep(hn::Mul(kernel_count, sums.kernel), step.before->count, step.after->count);
  keep(hn::Div(hn::Set(d, 2.0f), hn::Add(xx, yy)), step.before->tightness, step.after->tightness);
}

void SmoothRows(const SmoothStep& step, int first, int last) {
  const D d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int y = first; y < last; ++y) {
    for (int x = 0; x < step.area.width; x += lanes) {
      const size_t centre = step.area.at(x, y);
      if (!hn::AllFalse(d, hn::Gt(hn::LoadU(d, &step.samples->object[centre]), hn::Zero(d))))
        Solve(Gather(step, centre), step, centre);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(SmoothRows);

void internal::smooth_rows(const SmoothStep& step, int first, int last) {
  HWY_DYNAMIC_DISPATCH(SmoothRows)(step, first, last);
}

}  // namespace glasswing
#endif
