#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/peak_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstdint>

#include "solver/gaussian/peaks.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, kBlockLanes>;
using V = hn::Vec<D>;

void Insert(internal::LaneTops& tops, float height, int place) {
  int at = tops.count < kMaxPeaks ? tops.count++ : kMaxPeaks;
  if (at == kMaxPeaks && height <= tops.height[kMaxPeaks - 1]) return;
  at = std::min(at, kMaxPeaks - 1);
  while (at > 0 && tops.height[at - 1] < height) {
    tops.height[at] = tops.height[at - 1];
    tops.place[at] = tops.place[at - 1];
    --at;
  }
  tops.height[at] = height;
  tops.place[at] = place;
}

void FindTops(const SweepBlock& sweep, const float* floor, internal::LaneTops* tops) {
  const D d;
  constexpr int kGroup = 8;
  const int lanes = static_cast<int>(hn::Lanes(d)), count = sweep.count;
  HWY_ALIGN float heights[kBlockLanes];
  for (int first = 0; first < kBlockLanes; first += lanes) {
    const float* y = sweep.y + first;
    // Four times the smoothed samples throughout.
    const V least = hn::Mul(hn::LoadU(d, floor + first), hn::Set(d, 4.0f)), nothing = hn::Set(d, -1e30f);
    const auto sample = [&](int i) { return hn::LoadU(d, y + std::clamp(i, 0, count - 1) * kBlockLanes); };
    for (int begin = 0; begin < count; begin += kGroup) {
      const int end = std::min(begin + kGroup, count);
      // Most of a sweep is dark: if no sample rises above the floor, no smoothed one does.
      V highest = hn::Max(sample(begin - 1), sample(end));
      for (int i = begin; i < end; ++i) highest = hn::Max(highest, hn::LoadU(d, y + i * kBlockLanes));
      if (hn::AllTrue(d, hn::Le(hn::Mul(highest, hn::Set(d, 4.0f)), least))) continue;
      // (1 2 1) is (1 1) applied twice.
      V here = sample(begin), pair = hn::Add(sample(begin - 1), here), ahead = sample(begin + 1),
        next_pair = hn::Add(here, ahead), now = hn::Add(pair, next_pair);
      V last = begin > 0 ? hn::Add(hn::Add(sample(begin - 2), sample(begin - 1)), pair) : nothing;
      for (int i = begin; i < end; ++i) {
        here = ahead, pair = next_pair;
        ahead = sample(i + 2);
        next_pair = hn::Add(here, ahead);
        const V next = i + 1 < count ? hn::Add(pair, next_pair) : nothing;
        const auto top = hn::And(hn::And(hn::Gt(now, last), hn::Ge(now, next)), hn::Gt(now, least));
        if (HWY_UNLIKELY(!hn::AllFalse(d, top))) {
          hn::Store(now, d, heights);
          std::uint8_t bits[8] = {};
          hn::StoreMaskBits(d, top, bits);
          for (unsigned rest = bits[0] | bits[1] << 8; rest != 0; rest &= rest - 1) {
            const int lane = std::countr_zero(rest);
            Insert(tops[first + lane], 0.25f * heights[lane], i);
          }
        }
        last = now;
        now = next;
      }
    }
  }
}

void EstimateNoise(const SweepBlock& sweep, float* noise_sd) {
  const D d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int first = 0; first < kBlockLanes; first += lanes) {
    const float* y = sweep.y + first;
    // The mean of |normal| within 3 sd: sqrt(2 / pi) (1 - exp(-9 / 2)) / 0.9973.
    constexpr float kMeanWithin = 0.79116f;
    V limit = hn::Set(d, 1e30f), sd = hn::Zero(d);
    for (int round = 0; round < 5; ++round) {
      V sum = hn::Zero(d), count = hn::Zero(d);
      V a = hn::LoadU(d, y), b = hn::LoadU(d, y + kBlockLanes);
      for (int i = 2; i < sweep.count; ++i) {
        const V c = hn::LoadU(d, y + i * kBlockLanes);
        const V difference = hn::Abs(hn::Sub(hn::Add(a, c), hn::Add(b, b)));
        const auto within = hn::Le(difference, limit);
        sum = hn::Add(sum, hn::IfThenElseZero(within, difference));
        count = hn::Add(count, hn::IfThenElseZero(within, hn::Set(d, 1.0f)));
        a = b, b = c;
      }
      sd = hn::Div(sum, hn::Mul(hn::Max(count, hn::Set(d, 1.0f)),
                                hn::Set(d, (round == 0 ? 0.79788f : kMeanWithin) * 2.4494897f)));
      limit = hn::Mul(sd, hn::Set(d, 3.0f * 2.4494897f));
    }
    hn::StoreU(sd, d, noise_sd + first);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(FindTops);
HWY_EXPORT(EstimateNoise);

std::array<float, kBlockLanes> estimate_noise(const SweepBlock& sweep) {
  std::array<float, kBlockLanes> noise_sd{};
  if (sweep.count >= 5) HWY_DYNAMIC_DISPATCH(EstimateNoise)(sweep, noise_sd.data());
  return noise_sd;
}

void internal::find_tops(const SweepBlock& sweep, const float* floor, LaneTops* tops) {
  HWY_DYNAMIC_DISPATCH(FindTops)(sweep, floor, tops);
}

}  // namespace glasswing
#endif
