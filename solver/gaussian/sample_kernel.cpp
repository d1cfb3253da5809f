#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/sample_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "solver/gaussian/sample_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, kBlockLanes>;
using V = hn::Vec<D>;
constexpr int kRounds = 5;  // of bisection

V Codes(const std::uint16_t* codes) {
  const D d;
  const hn::Rebind<std::int32_t, D> wide;
  const hn::Rebind<std::uint16_t, D> narrow;
  return hn::ConvertTo(d, hn::PromoteTo(wide, hn::LoadU(narrow, codes)));
}

// Returns the highest code.
std::uint16_t LoadFrame(const std::uint16_t* codes, int lane_count, float zero, float unit, float* to,
                        size_t block_stride) {
  const D d;
  const V none = hn::Set(d, zero), one = hn::Set(d, unit);
  const int lanes = static_cast<int>(hn::Lanes(d));
  V highest = hn::Zero(d);
  int lane = 0;
  for (; lane + kBlockLanes <= lane_count; lane += kBlockLanes, to += block_stride) {
    for (int i = 0; i < kBlockLanes; i += lanes) {
      const V code = Codes(codes + lane + i);
      highest = hn::Max(highest, code);
      hn::StoreU(hn::Mul(hn::Sub(code, none), one), d, to + i);
    }
  }
  auto most = static_cast<std::uint16_t>(hn::GetLane(hn::MaxOfLanes(d, highest)));
  for (int i = 0; lane + i < lane_count; ++i) {
    to[i] = (static_cast<float>(codes[lane + i]) - zero) * unit;
    most = std::max(most, codes[lane + i]);
  }
  return most;
}

// By bisection: lanes can only count in parallel.
void MedianNear(const float* samples, size_t sample_count, const float* middle, const float* reach,
                float* median) {
  const D d;
  for (int first = 0; first < kBlockLanes; first += static_cast<int>(hn::Lanes(d))) {
    const V centre = hn::LoadU(d, middle + first), width = hn::LoadU(d, reach + first),
            one = hn::Set(d, 1.0f);
    V low = hn::Sub(centre, width), high = hn::Add(centre, width);
    const V from = low, to = high;
    const float* at = samples + first;
    V total = one;
    for (size_t i = 0; i < sample_count; ++i) {
      const V value = hn::LoadU(d, at + i * kBlockLanes);
      total = hn::Add(total, hn::IfThenElseZero(hn::And(hn::Ge(value, from), hn::Le(value, to)), one));
    }
    const V half = hn::Mul(total, hn::Set(d, 0.5f));
    for (int round = 0; round < kRounds; ++round) {
      const V guess = hn::Mul(hn::Set(d, 0.5f), hn::Add(low, high));
      V below = hn::IfThenElseZero(hn::Le(centre, guess), one);
      for (size_t i = 0; i < sample_count; ++i) {
        const V value = hn::LoadU(d, at + i * kBlockLanes);
        below = hn::Add(below, hn::IfThenElseZero(hn::And(hn::Ge(value, from), hn::Le(value, guess)), one));
      }
      const auto above = hn::Lt(below, half);
      low = hn::IfThenElse(above, guess, low);
      high = hn::IfThenElse(above, high, guess);
    }
    hn::StoreU(hn::Mul(hn::Set(d, 0.5f), hn::Add(low, high)), d, median + first);
  }
}

void CountCutOff(const float* samples, size_t sample_count, float cut_off, float* share) {
  const D d;
  const V limit = hn::Set(d, cut_off), one = hn::Set(d, 1.0f);
  for (int first = 0; first < kBlockLanes; first += static_cast<int>(hn::Lanes(d))) {
    V count = hn::Zero(d), pairs = hn::Zero(d), before = hn::Zero(d);
    for (size_t i = 0; i < sample_count; ++i) {
      const V cut = hn::IfThenElseZero(hn::Le(hn::LoadU(d, samples + i * kBlockLanes + first), limit), one);
      count = hn::Add(count, cut);
      pairs = hn::MulAdd(cut, before, pairs);
      before = cut;
    }
    constexpr float kSideBySide = 0.75f;
    const auto noise = hn::Le(pairs, hn::Mul(hn::Set(d, kSideBySide), count));
    hn::StoreU(hn::IfThenElseZero(noise, hn::Mul(count, hn::Set(d, 1.0f / static_cast<float>(sample_count)))),
               d, share + first);
  }
}

void ScaleSamples(float* samples, float* weights, const float* inverse_peak, size_t sample_count,
                  const internal::LaneScale& scale, internal::LaneSums& sums) {
  const D d;
  const V zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  for (int first = 0; first < kBlockLanes; first += static_cast<int>(hn::Lanes(d))) {
    const auto load = [&](const float* row) { return hn::LoadU(d, row + first); };
    const V baseline = load(scale.baseline), read = load(scale.read_variance), gain = load(scale.gain),
            dark = load(scale.dark_variance);
    V squares = load(sums.floor_squares), products = load(sums.floor_products), highest = load(sums.highest),
      least = load(sums.least_weight);
    for (size_t i = 0; i < sample_count; ++i) {
      const size_t at = i * kBlockLanes + static_cast<size_t>(first);
      const V radiance = hn::LoadU(d, samples + at), above = hn::Sub(radiance, baseline);
      if (weights == nullptr) {
        hn::StoreU(above, d, samples + at);
        squares = hn::Add(squares, one);
        products = hn::Add(products, above);
        highest = hn::Max(highest, above);
        continue;
      }
      const V u = hn::LoadU(d, inverse_peak + at), own = hn::LoadU(d, weights + at), y = hn::Mul(above, u);
      least = hn::Min(least, own);
      const V variance = hn::Mul(hn::MulAdd(gain, hn::Max(radiance, zero), read), hn::Mul(u, u));
      const V weight = hn::IfThenElseZero(hn::Gt(u, zero), hn::Div(hn::Mul(own, dark), variance));
      hn::StoreU(y, d, samples + at);
      hn::StoreU(weight, d, weights + at);
      const V answer = hn::Mul(hn::Max(weight, zero), u);
      squares = hn::MulAdd(answer, u, squares);
      products = hn::MulAdd(answer, y, products);
      highest = hn::Max(highest, y);
    }
    hn::StoreU(squares, d, sums.floor_squares + first), hn::StoreU(products, d, sums.floor_products + first);
    hn::StoreU(highest, d, sums.highest + first), hn::StoreU(least, d, sums.least_weight + first);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(LoadFrame);
HWY_EXPORT(MedianNear);
HWY_EXPORT(CountCutOff);
HWY_EXPORT(ScaleSamples);

std::uint16_t internal::load_frame(const std::uint16_t* codes, int lane_count, float zero, float unit,
                                   float* to, size_t block_stride) {
  return HWY_DYNAMIC_DISPATCH(LoadFrame)(codes, lane_count, zero, unit, to, block_stride);
}

void internal::median_near(const float* samples, size_t sample_count, const float* middle, const float* reach,
                           float* median) {
  HWY_DYNAMIC_DISPATCH(MedianNear)(samples, sample_count, middle, reach, median);
}

void internal::count_cut_off(const float* samples, size_t sample_count, float cut_off, float* share) {
  HWY_DYNAMIC_DISPATCH(CountCutOff)(samples, sample_count, cut_off, share);
}

void internal::scale_samples(float* samples, float* weights, const float* inverse_peak, size_t sample_count,
                             const LaneScale& scale, LaneSums& sums) {
  HWY_DYNAMIC_DISPATCH(ScaleSamples)(samples, weights, inverse_peak, sample_count, scale, sums);
}

}  // namespace glasswing
#endif
