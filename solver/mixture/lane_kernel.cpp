#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/mixture/lane_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cmath>
#include <numbers>

#include "solver/mixture/pattern_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, PatternLanes::kPad>;
using V = hn::Vec<D>;

constexpr float kTau = 2.0f * std::numbers::pi_v<float>;

// by_x x + by_y y - from; far from 0 a float would be too coarse. Of turns, the part within half a turn of 0.
template <bool kTurns>
HWY_INLINE V argument(const internal::WaveLanes& lanes, const Footprint& seen, size_t k) {
#if HWY_TARGET == HWY_SCALAR
  const double along = lanes.by_x[k] * seen.x_px + lanes.by_y[k] * seen.y_px - lanes.from[k];
  return hn::Set(D(), static_cast<float>(kTurns ? along - std::nearbyint(along) : along));
#else
  const hn::Half<D> half;
  const hn::Rebind<double, hn::Half<D> > wide;
  const auto part = [&](size_t i) HWY_ATTR {
    const auto along = hn::MulAdd(hn::LoadU(wide, lanes.by_x + i), hn::Set(wide, seen.x_px),
                                  hn::MulSub(hn::LoadU(wide, lanes.by_y + i), hn::Set(wide, seen.y_px),
                                             hn::LoadU(wide, lanes.from + i)));
    return hn::DemoteTo(half, kTurns ? hn::Sub(along, hn::Round(along)) : along);
  };
  return hn::Combine(D(), part(k + hn::Lanes(half)), part(k));
#endif
}

struct Seen {
  V weight, xx, xy, yy;
};

// One vector of the columns, from a value's derivatives by what pixels show.
struct Answer {
  V by_weight, by_x, by_y, by_xx, by_xy, by_yy;
};
HWY_INLINE void store(const Answer& own, const Seen& seen, const internal::SeenSlopes& slopes, V scale,
                      size_t size, float* at) {
  const D d;
  const auto set = [&](float value) HWY_ATTR { return hn::Set(d, value); };
  const auto put = [&](size_t column, V value)
                       HWY_ATTR { hn::StoreU(hn::Mul(value, scale), d, at + column * size); };
  put(0, hn::Mul(seen.weight, own.by_weight));
  put(1, own.by_weight);
  put(2, hn::MulAdd(own.by_x, set(slopes.centre_by_centre_x),
                    hn::Mul(own.by_xx, set(slopes.variance_by_centre_x))));
  put(3, hn::MulAdd(own.by_y, set(slopes.centre_by_centre_y),
                    hn::Mul(own.by_yy, set(slopes.variance_by_centre_y))));
  put(4, hn::MulAdd(own.by_x, set(slopes.centre_by_variance_x),
                    hn::Mul(own.by_xx, set(slopes.variance_by_variance_x))));
  put(5, hn::Mul(own.by_xy, set(slopes.centre_by_centre_x * slopes.centre_by_centre_y)));
  put(6, hn::MulAdd(own.by_y, set(slopes.centre_by_variance_y),
                    hn::Mul(own.by_yy, set(slopes.variance_by_variance_y))));
}

HWY_INLINE Seen seen_of(const Footprint& seen) {
  const D d;
  return {.weight = hn::Set(d, static_cast<float>(seen.weight)),
          .xx = hn::Set(d, static_cast<float>(seen.xx_px2)),
          .xy = hn::Set(d, static_cast<float>(seen.xy_px2)),
          .yy = hn::Set(d, static_cast<float>(seen.yy_px2))};
}

HWY_INLINE V quadratic(const internal::WaveLanes& lanes, const Seen& seen, size_t k) {
  const D d;
  return hn::MulAdd(
      hn::LoadU(d, lanes.xx + k), seen.xx,
      hn::MulAdd(hn::LoadU(d, lanes.xy + k), seen.xy, hn::Mul(hn::LoadU(d, lanes.yy + k), seen.yy)));
}

void AnswerWaves(const internal::WaveLanes& lanes, const Footprint& footprint,
                 const internal::SeenSlopes& slopes, size_t begin, size_t end, size_t size,
                 const float* scale, float* columns) {
  const D d;
  const Seen seen = seen_of(footprint);
  const V half = hn::Set(d, 0.5f);
  for (size_t k = begin; k < end; k += hn::Lanes(d)) {
    const V angle = hn::Mul(argument<true>(lanes, footprint, k), hn::Set(d, kTau));
    const V fade = hn::Exp(d, hn::Max(quadratic(lanes, seen, k), hn::Set(d, -80.0f)));
    const V height = hn::Mul(hn::LoadU(d, lanes.height + k), fade);
    const V cosine = hn::Mul(height, hn::Cos(d, angle));
    const V light = hn::Mul(seen.weight, cosine);
    const V turned = hn::Mul(seen.weight, hn::Mul(height, hn::Sin(d, angle)));
    store({.by_weight = hn::Add(half, cosine),
           .by_x = hn::Mul(turned, hn::LoadU(d, lanes.fx + k)),
           .by_y = hn::Mul(turned, hn::LoadU(d, lanes.fy + k)),
           .by_xx = hn::Mul(light, hn::LoadU(d, lanes.xx + k)),
           .by_xy = hn::Mul(light, hn::LoadU(d, lanes.xy + k)),
           .by_yy = hn::Mul(light, hn::LoadU(d, lanes.yy + k))},
          seen, slopes, hn::LoadU(d, scale + k), size, columns + k);
  }
}

void AnswerStripes(const internal::WaveLanes& lanes, const Footprint& footprint,
                   const internal::SeenSlopes& slopes, size_t begin, size_t end, size_t size,
                   const float* scale, float* columns) {
  const D d;
  const Seen seen = seen_of(footprint);
  const V one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
  for (size_t k = begin; k < end; k += hn::Lanes(d)) {
    // c.s - r
    const V offset = argument<false>(lanes, footprint, k);
    const V by_variance = hn::Div(one, hn::Add(quadratic(lanes, seen, k), hn::LoadU(d, lanes.own_px2 + k)));
    const V pull = hn::Mul(offset, by_variance), square = hn::Mul(offset, pull);
    const V fall = hn::Exp(d, hn::Max(hn::Neg(hn::Mul(square, half)), hn::Set(d, -80.0f)));
    const V unit = hn::Mul(hn::Mul(hn::LoadU(d, lanes.height + k), hn::Sqrt(by_variance)), fall);
    const V light = hn::Mul(seen.weight, unit);
    const V by_centre = hn::Neg(hn::Mul(light, pull));
    const V by_square = hn::Mul(hn::Mul(light, hn::Sub(square, one)), hn::Mul(half, by_variance));
    store({.by_weight = unit,
           .by_x = hn::Mul(by_centre, hn::LoadU(d, lanes.fx + k)),
           .by_y = hn::Mul(by_centre, hn::LoadU(d, lanes.fy + k)),
           .by_xx = hn::Mul(by_square, hn::LoadU(d, lanes.xx + k)),
           .by_xy = hn::Mul(by_square, hn::LoadU(d, lanes.xy + k)),
           .by_yy = hn::Mul(by_square, hn::LoadU(d, lanes.yy + k))},
          seen, slopes, hn::LoadU(d, scale + k), size, columns + k);
  }
}

HWY_INLINE float sum_of(V lanes) {
  return hn::GetLane(hn::SumOfLanes(D(), lanes));
}

float Dot(const float* a, const float* b, size_t size) {
  const D d;
  V sum = hn::Zero(d);
  for (size_t k = 0; k < size; k += hn::Lanes(d))
    sum = hn::MulAdd(hn::LoadU(d, a + k), hn::LoadU(d, b + k), sum);
  return sum_of(sum);
}

void Centre(const float* root, double information, std::span<float* const> columns, size_t size) {
  const D d;
  for (float* const column : columns) {
    const V part = hn::Set(d, static_cast<float>(Dot(root, column, size) / information));
    for (size_t k = 0; k < size; k += hn::Lanes(d)) {
      hn::StoreU(hn::NegMulAdd(part, hn::LoadU(d, root + k), hn::LoadU(d, column + k)), d, column + k);
    }
  }
}

void Multiply(std::span<float* const> columns, size_t size, float* products) {
  const D d;
  for (size_t p = 0; p < columns.size(); ++p) {
    const float* const own = columns[p];
    size_t q = 0;
    for (; q + 3 <= p; q += 4) {
      const float *const a = columns[q], *const b = columns[q + 1], *const c = columns[q + 2],
                         *const e = columns[q + 3];
      V sum0 = hn::Zero(d), sum1 = sum0, sum2 = sum0, sum3 = sum0;
      for (size_t k = 0; k < size; k += hn::Lanes(d)) {
        const V at = hn::LoadU(d, own + k);
        sum0 = hn::MulAdd(at, hn::LoadU(d, a + k), sum0);
        sum1 = hn::MulAdd(at, hn::LoadU(d, b + k), sum1);
        sum2 = hn::MulAdd(at, hn::LoadU(d, c + k), sum2);
        sum3 = hn::MulAdd(at, hn::LoadU(d, e + k), sum3);
      }
      *products++ = sum_of(sum0);
      *products++ = sum_of(sum1);
      *products++ = sum_of(sum2);
      *products++ = sum_of(sum3);
    }
    for (; q <= p; ++q) *products++ = Dot(own, columns[q], size);
  }
}

// Several vectors of footprints at a time share what is broadcast.
void Correlate(const float* answers, std::span<const float> wanted, size_t stride, float* by_footprint) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  for (size_t k = 0; k < stride; k += 4 * lanes) {
    const float* at = answers + k;
    V sum0 = hn::Zero(d), sum1 = sum0, sum2 = sum0, sum3 = sum0;
    for (const float each : wanted) {
      const V own = hn::Set(d, each);
      sum0 = hn::MulAdd(own, hn::LoadU(d, at), sum0);
      sum1 = hn::MulAdd(own, hn::LoadU(d, at + lanes), sum1);
      sum2 = hn::MulAdd(own, hn::LoadU(d, at + 2 * lanes), sum2);
      sum3 = hn::MulAdd(own, hn::LoadU(d, at + 3 * lanes), sum3);
      at += stride;
    }
    hn::StoreU(sum0, d, by_footprint + k);
    hn::StoreU(sum1, d, by_footprint + k + lanes);
    hn::StoreU(sum2, d, by_footprint + k + 2 * lanes);
    hn::StoreU(sum3, d, by_footprint + k + 3 * lanes);
  }
}

void Weigh(const float* answers, std::span<const float> first, std::span<const float> second, size_t stride,
           float* sums, float* squares) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  for (size_t k = 0; k < stride; k += 2 * lanes) {
    const float* at = answers + k;
    V sum0 = hn::Zero(d), sum1 = sum0, square0 = sum0, square1 = sum0;
    for (size_t i = 0; i < first.size(); ++i) {
      const V own = hn::Set(d, first[i]), own2 = hn::Set(d, second[i]);
      const V answer0 = hn::LoadU(d, at), answer1 = hn::LoadU(d, at + lanes);
      sum0 = hn::MulAdd(own, answer0, sum0);
      sum1 = hn::MulAdd(own, answer1, sum1);
      square0 = hn::MulAdd(hn::Mul(own2, answer0), answer0, square0);
      square1 = hn::MulAdd(hn::Mul(own2, answer1), answer1, square1);
      at += stride;
    }
    hn::StoreU(sum0, d, sums + k);
    hn::StoreU(sum1, d, sums + k + lanes);
    hn::StoreU(square0, d, squares + k);
    hn::StoreU(square1, d, squares + k + lanes);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing::internal {

HWY_EXPORT(AnswerWaves);
HWY_EXPORT(AnswerStripes);
HWY_EXPORT(Dot);
HWY_EXPORT(Centre);
HWY_EXPORT(Multiply);
HWY_EXPORT(Correlate);
HWY_EXPORT(Weigh);

void answer_waves(const WaveLanes& lanes, const Footprint& seen, const SeenSlopes& slopes, size_t begin,
                  size_t end, size_t size, const float* scale, float* columns) {
  HWY_DYNAMIC_DISPATCH(AnswerWaves)(lanes, seen, slopes, begin, end, size, scale, columns);
}

void answer_stripes(const WaveLanes& lanes, const Footprint& seen, const SeenSlopes& slopes, size_t begin,
                    size_t end, size_t size, const float* scale, float* columns) {
  HWY_DYNAMIC_DISPATCH(AnswerStripes)(lanes, seen, slopes, begin, end, size, scale, columns);
}

float dot(const float* a, const float* b, size_t size) {
  return HWY_DYNAMIC_DISPATCH(Dot)(a, b, size);
}

void centre(const float* root, double information, std::span<float* const> columns, size_t size) {
  HWY_DYNAMIC_DISPATCH(Centre)(root, information, columns, size);
}

void multiply(std::span<float* const> columns, size_t size, float* products) {
  HWY_DYNAMIC_DISPATCH(Multiply)(columns, size, products);
}

void correlate(const float* answers, std::span<const float> wanted, size_t stride, float* by_footprint) {
  HWY_DYNAMIC_DISPATCH(Correlate)(answers, wanted, stride, by_footprint);
}

void weigh(const float* answers, std::span<const float> first, std::span<const float> second, size_t stride,
           float* sums, float* squares) {
  HWY_DYNAMIC_DISPATCH(Weigh)(answers, first, second, stride, sums, squares);
}

}  // namespace glasswing::internal
#endif
