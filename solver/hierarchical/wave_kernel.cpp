#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/hierarchical/wave_kernel.cpp"
#include <hwy/foreach_target.h>
//
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

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing::internal {

HWY_EXPORT(BoundOf);
HWY_EXPORT(CostOf);

float bound_of(const CellPair& pair, const float* u, const float* weight, size_t stride) {
  return HWY_DYNAMIC_DISPATCH(BoundOf)(pair, u, weight, stride);
}

float cost_of(const PlacePair& pair, const float* u, const float* weight, size_t stride) {
  return HWY_DYNAMIC_DISPATCH(CostOf)(pair, u, weight, stride);
}

}  // namespace glasswing::internal
#endif
