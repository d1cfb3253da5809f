#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/hierarchical/wave_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "solver/hierarchical/wave_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

float BoundOf(const internal::CellPair& pair, const float* u, const float* weight, size_t stride) {
  const hn::CappedTag<float, internal::kWaveLanes> d;
  using V = hn::Vec<decltype(d)>;
  const float hull = pair.longest;
  const V one = hn::Set(d, 1.0f), minus_one = hn::Set(d, -1.0f), by_hull = hn::Set(d, hull);
  const V by_shortest = hn::Set(d, 1.0f / pair.shortest), by_longest = hn::Set(d, 1.0f / hull);
  V sum = hn::Zero(d);
  for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
    const V bottom = hn::Sub(hn::LoadU(d, pair.high + k), hn::LoadU(d, pair.low + stride + k));
    const V top = hn::Sub(hn::LoadU(d, pair.high + stride + k), hn::LoadU(d, pair.low + k));
    const V inside = hn::Sub(hn::LoadU(d, pair.last + k), hn::LoadU(d, pair.first + k));
    const V least = hn::Max(hn::Min(hn::Mul(bottom, by_shortest), hn::Mul(bottom, by_longest)),
                            hn::Max(hn::NegMulAdd(hn::Sub(by_hull, inside), by_shortest, one), minus_one));
    const V most = hn::Min(hn::Max(hn::Mul(top, by_shortest), hn::Mul(top, by_longest)),
                           hn::Min(hn::MulAdd(hn::Add(by_hull, inside), by_shortest, minus_one), one));
    const V seen = hn::LoadU(d, u + k);
    const V miss = hn::Max(hn::Max(hn::Sub(least, seen), hn::Sub(seen, most)), hn::Zero(d));
    sum = hn::MulAdd(hn::Mul(hn::LoadU(d, weight + k), miss), miss, sum);
  }
  return hn::GetLane(hn::SumOfLanes(d, sum));
}

float CostOf(const internal::PlacePair& pair, const float* u, const float* weight, size_t stride) {
  const hn::CappedTag<float, internal::kWaveLanes> d;
  using V = hn::Vec<decltype(d)>;
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
  return hn::GetLane(hn::SumOfLanes(d, sum));
}

// (1 - erf(z / sqrt2)) / exp(-z^2 / 2) for z >= 0; Abramowitz and Stegun 7.1.26, error < 1.5e-7.
template <class D, class V>
V TailPart(D d, V z) {
  const V t = hn::Div(hn::Set(d, 1.0f), hn::MulAdd(hn::Set(d, 0.2316418882f), z, hn::Set(d, 1.0f)));
  V sum = hn::MulAdd(hn::Set(d, 1.061405429f), t, hn::Set(d, -1.453152027f));
  sum = hn::MulAdd(sum, t, hn::Set(d, 1.421413741f));
  sum = hn::MulAdd(sum, t, hn::Set(d, -0.284496736f));
  sum = hn::MulAdd(sum, t, hn::Set(d, 0.254829592f));
  return hn::Mul(sum, t);
}

void SoftMeansOf(const internal::SoftWaves& waves, float t_px, float sigma_px, size_t stride, float* v,
                 float* by_t, float* by_sigma) {
  const hn::CappedTag<float, internal::kWaveLanes> d;
  using V = hn::Vec<decltype(d)>;
  constexpr float kPi = 3.14159265358979f, kSlope = 0.797884560802865f;  // sqrt(2 / pi)
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
  const V t = hn::Set(d, t_px), sigma = hn::Set(d, sigma_px), by_px = hn::Set(d, 1.0f / sigma_px);
  for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
    const V width = hn::LoadU(d, waves.bar_px + k), from = hn::Sub(t, hn::LoadU(d, waves.offset_px + k));
    const V bar = hn::Floor(hn::Div(from, width));
    const V inside = hn::Min(hn::Max(hn::NegMulAdd(bar, width, from), zero), width);
    const V odd = hn::NegMulAdd(hn::Floor(hn::Mul(bar, half)), hn::Set(d, 2.0f), bar);
    const V sign = hn::NegMulAdd(odd, hn::Set(d, 2.0f), one);
    // Both edges of the bar.
    const V z0 = hn::Mul(inside, by_px), z1 = hn::Mul(hn::Sub(width, inside), by_px);
    const V g0 = hn::Exp(d, hn::Mul(hn::Mul(z0, z0), hn::Set(d, -0.5f)));
    const V g1 = hn::Exp(d, hn::Mul(hn::Mul(z1, z1), hn::Set(d, -0.5f)));
    V mean = hn::NegMulAdd(g0, TailPart(d, z0), hn::NegMulAdd(g1, TailPart(d, z1), one));
    const V slope = hn::Mul(by_px, hn::Set(d, kSlope));
    V along = hn::Mul(slope, hn::Sub(g0, g1));
    V wider = hn::Neg(hn::Mul(slope, hn::MulAdd(z0, g0, hn::Mul(z1, g1))));
    const auto narrow = hn::Gt(sigma, hn::Mul(width, hn::Set(d, 0.25f)));
    if (!hn::AllFalse(d, narrow)) {
      // The third harmonic by the first one's.
      const V rate = hn::Div(hn::Set(d, kPi), width), phase = hn::Mul(rate, inside);
      const V spread = hn::Mul(hn::Mul(rate, rate), sigma);
      const V sine = hn::Sin(d, phase), cosine = hn::Cos(d, phase);
      const V fade = hn::Exp(d, hn::Mul(hn::Mul(spread, sigma), hn::Set(d, -0.5f)));
      const V fade2 = hn::Mul(fade, fade), fade4 = hn::Mul(fade2, fade2);
      const V size = hn::Mul(fade, hn::Set(d, 4.0f / kPi));
      const V size3 = hn::Mul(hn::Mul(hn::Mul(fade4, fade4), size), hn::Set(d, 1.0f / 3.0f));
      const V four = hn::Set(d, 4.0f), three = hn::Set(d, 3.0f);
      const V sine3 = hn::Mul(sine, hn::NegMulAdd(four, hn::Mul(sine, sine), three));
      const V cosine3 = hn::Mul(cosine, hn::MulSub(four, hn::Mul(cosine, cosine), three));
      const V first = hn::Mul(size, sine), third = hn::Mul(size3, sine3);
      mean = hn::IfThenElse(narrow, hn::Add(first, third), mean);
      along = hn::IfThenElse(
          narrow, hn::Mul(rate, hn::MulAdd(size, cosine, hn::Mul(three, hn::Mul(size3, cosine3)))), along);
      wider =
          hn::IfThenElse(narrow, hn::Neg(hn::Mul(spread, hn::MulAdd(hn::Set(d, 9.0f), third, first))), wider);
    }
    hn::StoreU(hn::Mul(sign, mean), d, v + k);
    hn::StoreU(hn::Mul(sign, along), d, by_t + k);
    hn::StoreU(hn::Mul(sign, wider), d, by_sigma + k);
  }
}

void GramOf(const float* rows, const float* weight, size_t count, double* gram) {
  const hn::CappedTag<double, internal::kGramColumns> d;
  const hn::Rebind<float, decltype(d)> narrow;
  using V = hn::Vec<decltype(d)>;
  constexpr size_t kColumns = internal::kGramColumns;
  for (size_t j = 0; j < kColumns; j += hn::Lanes(d)) {
    V s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0, s4 = s0, s5 = s0, s6 = s0, s7 = s0;
    for (size_t k = 0; k < count; ++k) {
      const float* row = rows + k * kColumns;
      const V own = hn::Mul(hn::PromoteTo(d, hn::LoadU(narrow, row + j)), hn::Set(d, double{weight[k]}));
      s0 = hn::MulAdd(own, hn::Set(d, double{row[0]}), s0);
      s1 = hn::MulAdd(own, hn::Set(d, double{row[1]}), s1);
      s2 = hn::MulAdd(own, hn::Set(d, double{row[2]}), s2);
      s3 = hn::MulAdd(own, hn::Set(d, double{row[3]}), s3);
      s4 = hn::MulAdd(own, hn::Set(d, double{row[4]}), s4);
      s5 = hn::MulAdd(own, hn::Set(d, double{row[5]}), s5);
      s6 = hn::MulAdd(own, hn::Set(d, double{row[6]}), s6);
      s7 = hn::MulAdd(own, hn::Set(d, double{row[7]}), s7);
    }
    hn::StoreU(s0, d, gram + j);
    hn::StoreU(s1, d, gram + kColumns + j);
    hn::StoreU(s2, d, gram + 2 * kColumns + j);
    hn::StoreU(s3, d, gram + 3 * kColumns + j);
    hn::StoreU(s4, d, gram + 4 * kColumns + j);
    hn::StoreU(s5, d, gram + 5 * kColumns + j);
    hn::StoreU(s6, d, gram + 6 * kColumns + j);
    hn::StoreU(s7, d, gram + 7 * kColumns + j);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing::internal {

HWY_EXPORT(BoundOf);
HWY_EXPORT(CostOf);
HWY_EXPORT(SoftMeansOf);
HWY_EXPORT(GramOf);

float bound_of(const CellPair& pair, const float* u, const float* weight, size_t stride) {
  return HWY_DYNAMIC_DISPATCH(BoundOf)(pair, u, weight, stride);
}

float cost_of(const PlacePair& pair, const float* u, const float* weight, size_t stride) {
  return HWY_DYNAMIC_DISPATCH(CostOf)(pair, u, weight, stride);
}

void soft_means_of(const SoftWaves& waves, float t_px, float sigma_px, size_t stride, float* v, float* by_t,
                   float* by_sigma) {
  HWY_DYNAMIC_DISPATCH(SoftMeansOf)(waves, t_px, sigma_px, stride, v, by_t, by_sigma);
}

void gram_of(const float* rows, const float* weight, size_t count, double* gram) {
  HWY_DYNAMIC_DISPATCH(GramOf)(rows, weight, count, gram);
}

}  // namespace glasswing::internal
#endif
