#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/hierarchical/wave_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <numbers>

#include "solver/hierarchical/wave_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, internal::kWaveLanes>;
using V = hn::Vec<Lanes>;

HWY_INLINE float sum_of(V lanes) {
  return hn::GetLane(hn::SumOfLanes(Lanes(), lanes));
}

std::array<float, 4> BoundsOf(const internal::CellPairs& pairs, const float* u, const float* weight,
                              size_t stride) {
  const Lanes d;
  const V one = hn::Set(d, 1.0f), minus_one = hn::Set(d, -1.0f);
  std::array<float, 4> by_shortest, by_longest;
  for (size_t i = 0; i < 4; ++i) {
    by_shortest[i] = 1.0f / pairs.shortest[i];
    by_longest[i] = 1.0f / pairs.longest[i];
  }
  V sum0 = hn::Zero(d), sum1 = sum0, sum2 = sum0, sum3 = sum0;
  for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
    const V seen = hn::LoadU(d, u + k), own = hn::LoadU(d, weight + k);
    const auto add = [&](size_t low, size_t high, V& sum) HWY_ATTR {
      const size_t i = 2 * low + high;
      const V bottom = hn::Sub(hn::LoadU(d, pairs.high[high] + k), hn::LoadU(d, pairs.low[low] + stride + k));
      const V top = hn::Sub(hn::LoadU(d, pairs.high[high] + stride + k), hn::LoadU(d, pairs.low[low] + k));
      const V inside = hn::Sub(hn::LoadU(d, pairs.last[high] + k), hn::LoadU(d, pairs.first[low] + k));
      const V shortest = hn::Set(d, by_shortest[i]), longest = hn::Set(d, by_longest[i]),
              hull = hn::Set(d, pairs.longest[i]);
      const V least = hn::Max(hn::Min(hn::Mul(bottom, shortest), hn::Mul(bottom, longest)),
                              hn::Max(hn::NegMulAdd(hn::Sub(hull, inside), shortest, one), minus_one));
      const V most = hn::Min(hn::Max(hn::Mul(top, shortest), hn::Mul(top, longest)),
                             hn::Min(hn::MulAdd(hn::Add(hull, inside), shortest, minus_one), one));
      const V miss = hn::Max(hn::Max(hn::Sub(least, seen), hn::Sub(seen, most)), hn::Zero(d));
      sum = hn::MulAdd(hn::Mul(own, miss), miss, sum);
    };
    add(0, 0, sum0);
    add(0, 1, sum1);
    add(1, 0, sum2);
    add(1, 1, sum3);
  }
  return {sum_of(sum0), sum_of(sum1), sum_of(sum2), sum_of(sum3)};
}

float CostOf(const internal::PlacePair& pair, const float* u, const float* weight, size_t stride) {
  const Lanes d;
  const V scale = hn::Set(d, 1.0f / pair.distance), low_part = hn::Set(d, pair.low_part),
          high_part = hn::Set(d, pair.high_part);
  V sum = hn::Zero(d);
  for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
    const V low = hn::LoadU(d, pair.low + k), high = hn::LoadU(d, pair.high + k);
    const V at_low = hn::Sub(hn::LoadU(d, pair.low + stride + k), low);
    const V at_high = hn::Sub(hn::LoadU(d, pair.high + stride + k), high);
    // The integers first: their difference is exact.
    const V inside = hn::MulAdd(high_part, at_high, hn::NegMulAdd(low_part, at_low, hn::Sub(high, low)));
    const V miss = hn::NegMulAdd(inside, scale, hn::LoadU(d, u + k));
    sum = hn::MulAdd(hn::Mul(hn::LoadU(d, weight + k), miss), miss, sum);
  }
  return sum_of(sum);
}

std::array<float, 9> CostsOf(const internal::PlaceGrid& grid, const float* u, const float* weight,
                             size_t stride) {
  const Lanes d;
  std::array<float, 9> scale;
  for (size_t i = 0; i < 9; ++i) scale[i] = 1.0f / grid.distance[i];
  V sum00 = hn::Zero(d), sum01 = sum00, sum02 = sum00, sum10 = sum00, sum11 = sum00, sum12 = sum00,
    sum20 = sum00, sum21 = sum00, sum22 = sum00;
  for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
    const V low = hn::LoadU(d, grid.low[1] + k), high = hn::LoadU(d, grid.high[1] + k);
    const V base = hn::Sub(high, low), seen = hn::LoadU(d, u + k), own = hn::LoadU(d, weight + k);
    // The integers first: their difference is exact.
    const auto beyond = [&](const float* p, float part, V from) HWY_ATTR {
      const V at = hn::LoadU(d, p + k);
      return hn::MulAdd(hn::Set(d, part), hn::Sub(hn::LoadU(d, p + stride + k), at), hn::Sub(at, from));
    };
    const V h0 = beyond(grid.high[0], grid.high_part[0], high),
            h1 = beyond(grid.high[1], grid.high_part[1], high),
            h2 = beyond(grid.high[2], grid.high_part[2], high);
    const auto add = [&](V rest, V at_high, size_t i, V& sum) HWY_ATTR {
      const V miss = hn::NegMulAdd(hn::Add(rest, at_high), hn::Set(d, scale[i]), seen);
      sum = hn::MulAdd(hn::Mul(own, miss), miss, sum);
    };
    const V l0 = hn::Sub(base, beyond(grid.low[0], grid.low_part[0], low));
    add(l0, h0, 0, sum00);
    add(l0, h1, 1, sum01);
    add(l0, h2, 2, sum02);
    const V l1 = hn::Sub(base, beyond(grid.low[1], grid.low_part[1], low));
    add(l1, h0, 3, sum10);
    add(l1, h1, 4, sum11);
    add(l1, h2, 5, sum12);
    const V l2 = hn::Sub(base, beyond(grid.low[2], grid.low_part[2], low));
    add(l2, h0, 6, sum20);
    add(l2, h1, 7, sum21);
    add(l2, h2, 8, sum22);
  }
  return {sum_of(sum00), sum_of(sum01), sum_of(sum02), sum_of(sum10), sum_of(sum11),
          sum_of(sum12), sum_of(sum20), sum_of(sum21), sum_of(sum22)};
}

struct SoftMean {
  V v, by_t, by_sigma;
};

// Of waves k and on.
HWY_INLINE SoftMean soft_mean_of(const internal::SoftWaves& waves, const internal::SoftPlace& place,
                                 size_t k) {
  const Lanes d;
  constexpr float kPi = std::numbers::pi_v<float>;
  const V zero = hn::Zero(d), half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
  const V bar_px = hn::LoadU(d, waves.bar_px + k);
  const V whole_px = hn::Sub(hn::Set(d, place.whole_px), hn::LoadU(d, waves.offset_px + k));
  const V part_px = hn::Set(d, place.part_px), sigma_px = hn::Set(d, place.sigma_px);
  const V by_sigma = hn::Div(one, sigma_px), by_bar = hn::Div(one, bar_px);
  const V bar = hn::Floor(hn::Mul(hn::Add(whole_px, part_px), by_bar));
  const V inside_px = hn::Clamp(hn::Add(hn::NegMulAdd(bar, bar_px, whole_px), part_px), zero, bar_px);
  const V half_bar = hn::Mul(bar, half);
  // +1 in lit bars, which are the even ones.
  const V sign = hn::NegMulAdd(hn::Set(d, 4.0f), hn::Sub(half_bar, hn::Floor(half_bar)), one);
  // 1 - erf(z / sqrt2), from Abramowitz and Stegun 1964, 7.1.26: error < 2e-7; and its derivative by -z.
  const auto edge = [&](V z, V& slope) HWY_ATTR {
    const V fall = hn::Exp(d, hn::Mul(hn::Mul(z, z), hn::Set(d, -0.5f)));
    slope = hn::Mul(fall, hn::Set(d, 0.797884561f));
    const V t = hn::Div(one, hn::MulAdd(z, hn::Set(d, 0.3275911f * 0.707106781f), one));
    V sum = hn::MulAdd(hn::Set(d, 1.061405429f), t, hn::Set(d, -1.453152027f));
    sum = hn::MulAdd(sum, t, hn::Set(d, 1.421413741f));
    sum = hn::MulAdd(sum, t, hn::Set(d, -0.284496736f));
    sum = hn::MulAdd(sum, t, hn::Set(d, 0.254829592f));
    return hn::Mul(hn::Mul(sum, t), fall);
  };
  const V far = hn::Set(d, 9.0f);  // sigmas
  const V z1 = hn::Min(hn::Mul(inside_px, by_sigma), far);
  const V z2 = hn::Min(hn::Mul(hn::Sub(bar_px, inside_px), by_sigma), far);
  V slope1, slope2;
  const V beyond1 = edge(z1, slope1), beyond2 = edge(z2, slope2);
  SoftMean mean;
  mean.v = hn::Sub(hn::Sub(one, beyond1), beyond2);
  mean.by_t = hn::Mul(hn::Sub(slope1, slope2), by_sigma);
  mean.by_sigma = hn::Neg(hn::Mul(hn::MulAdd(z1, slope1, hn::Mul(z2, slope2)), by_sigma));
  const auto fine = hn::Ge(hn::Mul(sigma_px, hn::Set(d, 4.0f)), bar_px);
  if (!hn::AllFalse(d, fine)) {
    // The third harmonic by the first one's.
    const V rate = hn::Mul(hn::Set(d, kPi), by_bar);
    const V phase = hn::MulSub(rate, inside_px, hn::Set(d, 0.5f * kPi));
    const V sine = hn::Cos(d, phase), cosine = hn::Neg(hn::Sin(d, phase));
    const V spread = hn::Mul(hn::Mul(rate, rate), sigma_px);
    const V fade =
        hn::Exp(d, hn::Max(hn::Mul(hn::Mul(spread, sigma_px), hn::Set(d, -0.5f)), hn::Set(d, -40.0f)));
    const V fade2 = hn::Mul(fade, fade), fade4 = hn::Mul(fade2, fade2);
    const V size = hn::Mul(fade, hn::Set(d, 4.0f / kPi));
    const V size3 = hn::Mul(hn::Mul(size, hn::Mul(fade4, fade4)), hn::Set(d, 1.0f / 3.0f));
    const V three = hn::Set(d, 3.0f), four = hn::Set(d, 4.0f);
    const V first = hn::Mul(size, sine);
    const V third = hn::Mul(size3, hn::Mul(sine, hn::NegMulAdd(four, hn::Mul(sine, sine), three)));
    const V third_by = hn::Mul(size3, hn::Mul(cosine, hn::MulSub(four, hn::Mul(cosine, cosine), three)));
    mean.v = hn::IfThenElse(fine, hn::Add(first, third), mean.v);
    mean.by_t =
        hn::IfThenElse(fine, hn::Mul(rate, hn::MulAdd(three, third_by, hn::Mul(size, cosine))), mean.by_t);
    mean.by_sigma = hn::IfThenElse(fine, hn::Neg(hn::Mul(spread, hn::MulAdd(hn::Set(d, 9.0f), third, first))),
                                   mean.by_sigma);
  }
  mean.v = hn::Mul(mean.v, sign);
  mean.by_t = hn::Mul(mean.by_t, sign);
  mean.by_sigma = hn::Mul(mean.by_sigma, sign);
  return mean;
}

void SoftMeansOf(const internal::SoftWaves& waves, const internal::SoftPlace& place, size_t stride, float* v,
                 float* by_t, float* by_sigma) {
  const Lanes d;
  for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
    const SoftMean mean = soft_mean_of(waves, place, k);
    hn::StoreU(mean.v, d, v + k);
    hn::StoreU(mean.by_t, d, by_t + k);
    hn::StoreU(mean.by_sigma, d, by_sigma + k);
  }
}

internal::SoftSums SoftSumsOf(const internal::SoftWaves& waves, const internal::SoftPlace& place,
                              const float* u, const float* weight, size_t stride) {
  const Lanes d;
  V cost = hn::Zero(d), t = cost, s = cost, tt = cost, ts = cost, ss = cost;
  for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
    const SoftMean mean = soft_mean_of(waves, place, k);
    const V own = hn::LoadU(d, weight + k);
    const V rest = hn::Sub(hn::LoadU(d, u + k), mean.v);
    const V own_rest = hn::Mul(own, rest), own_t = hn::Mul(own, mean.by_t),
            own_s = hn::Mul(own, mean.by_sigma);
    cost = hn::MulAdd(own_rest, rest, cost);
    t = hn::MulAdd(own_rest, mean.by_t, t);
    s = hn::MulAdd(own_rest, mean.by_sigma, s);
    tt = hn::MulAdd(own_t, mean.by_t, tt);
    ts = hn::MulAdd(own_t, mean.by_sigma, ts);
    ss = hn::MulAdd(own_s, mean.by_sigma, ss);
  }
  return {.cost = sum_of(cost),
          .t = sum_of(t),
          .s = sum_of(s),
          .tt = sum_of(tt),
          .ts = sum_of(ts),
          .ss = sum_of(ss)};
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing::internal {

HWY_EXPORT(BoundsOf);
HWY_EXPORT(CostOf);
HWY_EXPORT(CostsOf);
HWY_EXPORT(SoftMeansOf);
HWY_EXPORT(SoftSumsOf);

std::array<float, 4> bounds_of(const CellPairs& pairs, const float* u, const float* weight, size_t stride) {
  return HWY_DYNAMIC_DISPATCH(BoundsOf)(pairs, u, weight, stride);
}

float cost_of(const PlacePair& pair, const float* u, const float* weight, size_t stride) {
  return HWY_DYNAMIC_DISPATCH(CostOf)(pair, u, weight, stride);
}

std::array<float, 9> costs_of(const PlaceGrid& grid, const float* u, const float* weight, size_t stride) {
  return HWY_DYNAMIC_DISPATCH(CostsOf)(grid, u, weight, stride);
}

void soft_means_of(const SoftWaves& waves, const SoftPlace& place, size_t stride, float* v, float* by_t,
                   float* by_sigma) {
  HWY_DYNAMIC_DISPATCH(SoftMeansOf)(waves, place, stride, v, by_t, by_sigma);
}

SoftSums soft_sums_of(const SoftWaves& waves, const SoftPlace& place, const float* u, const float* weight,
                      size_t stride) {
  return HWY_DYNAMIC_DISPATCH(SoftSumsOf)(waves, place, u, weight, stride);
}

}  // namespace glasswing::internal
#endif
