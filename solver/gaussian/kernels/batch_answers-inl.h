// The effect of flat pixels on a footprint, and the response of bars to it, a vector of footprints at once.
// Included once per target.
#if defined(GLASSWING_BATCH_ANSWERS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GLASSWING_BATCH_ANSWERS_INL_H_
#undef GLASSWING_BATCH_ANSWERS_INL_H_
#else
#define GLASSWING_BATCH_ANSWERS_INL_H_
#endif

#include <numbers>

#include "core/footprint/footprint.h"
#include "solver/gaussian/kernels/line_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

constexpr float kPi = std::numbers::pi_v<float>;

// Phi(-z), and phi(z) with it. Abramowitz and Stegun 7.1.26: |error| < 1.5e-7.
HWY_INLINE V Beyond(V z, V& density) {
  const D d;
  const V x = hn::Mul(hn::Abs(z), Set(0.70710678f));
  const V t = hn::Div(Set(1.0f), hn::MulAdd(x, Set(0.3275911f), Set(1.0f)));
  V p = Set(1.061405429f);
  p = hn::MulAdd(p, t, Set(-1.453152027f));
  p = hn::MulAdd(p, t, Set(1.421413741f));
  p = hn::MulAdd(p, t, Set(-0.284496736f));
  p = hn::MulAdd(p, t, Set(0.254829592f));
  const V e = hn::Exp(d, hn::Max(hn::Mul(Set(-0.5f), hn::Mul(z, z)), Set(-80.0f)));
  density = hn::Mul(e, Set(0.39894228f));
  const V tail = hn::Mul(hn::Mul(Set(0.5f), hn::Mul(p, t)), e);  // Phi(-|z|)
  return hn::IfThenElse(hn::Lt(z, hn::Zero(d)), hn::Sub(Set(1.0f), tail), tail);
}

// One axis of a footprint as stripes see it: seen_through_pixels of core/footprint/footprint.h.
struct SeenLane {
  V centre, variance;
  V centre_by_centre, centre_by_variance, variance_by_centre, variance_by_variance;
};

// From the edges of the pixels around the centre; for sigma below 0.33 px. `place`: of the centre within its
// pixel, from its middle.
HWY_INLINE SeenLane SeenFromEdges(V place, V variance) {
  const D d;
  const V zero = hn::Zero(d), least = Set(1e-4f);
  const V inverse = hn::Div(Set(1.0f), hn::Sqrt(hn::Max(variance, least)));
  V mean = zero, square = zero, mean_by_c = zero, square_by_c = zero, mean_by_v = zero, square_by_v = zero;
  for (const float edge : {-1.5f, -0.5f, 0.5f, 1.5f}) {
    const float sign = edge > 0.0f ? 1.0f : -1.0f, step = std::abs(edge) > 1.0f ? 3.0f : 1.0f;
    const V z = hn::Mul(hn::Sub(Set(edge), place), inverse);
    V density;
    const V beyond = Beyond(hn::Mul(Set(sign), z), density);
    density = hn::Mul(density, inverse);
    const V by_v = hn::Mul(hn::Mul(Set(0.5f), density), hn::Mul(z, inverse));
    mean = hn::MulAdd(Set(sign), beyond, mean);
    square = hn::MulAdd(Set(step), beyond, square);
    mean_by_c = hn::Add(mean_by_c, density);
    square_by_c = hn::MulAdd(Set(sign * step), density, square_by_c);
    mean_by_v = hn::Add(mean_by_v, by_v);
    square_by_v = hn::MulAdd(Set(sign * step), by_v, square_by_v);
  }
  const auto point = hn::Lt(variance, least);
  mean_by_v = hn::IfThenElse(point, zero, mean_by_v);
  square_by_v = hn::IfThenElse(point, zero, square_by_v);
  const V twice = hn::Add(mean, mean);
  return {.centre = hn::Sub(mean, place),
          .variance = hn::Sub(hn::NegMulAdd(mean, mean, square), Set(static_cast<float>(kFlatPixel_px2))),
          .centre_by_centre = mean_by_c,
          .centre_by_variance = mean_by_v,
          .variance_by_centre = hn::NegMulAdd(twice, mean_by_c, square_by_c),
          .variance_by_variance = hn::NegMulAdd(twice, mean_by_v, square_by_v)};
}

// By two terms of the Fourier series of floor(x) - x; for sigma above 0.3 px. With E_k = exp(-2 pi^2 k^2 v),
//   centre = c + sum_k sin(2 pi k c) E_k / (pi k) = c + M
//   variance = v + sum_k cos(2 pi k c) E_k (4 v + 1 / (pi k)^2) - M^2
// `place` is from the pixel's edge: from its middle, odd terms have the other sign.
HWY_INLINE SeenLane SeenFromWaves(V place, V variance) {
  const D d;
  const V angle = hn::Mul(Set(2.0f * kPi), place), sine = hn::Sin(d, angle), cosine = hn::Cos(d, angle);
  const V one = hn::Exp(d, hn::Max(hn::Mul(Set(-2.0f * kPi * kPi), variance), Set(-80.0f)));
  const V square = hn::Mul(one, one), fourth = hn::Mul(square, square);
  V moved = hn::Zero(d), spread = variance, c_by_c = Set(1.0f), c_by_v = hn::Zero(d), v_by_c = hn::Zero(d),
    v_by_v = Set(1.0f);
  for (const float k : {1.0f, 2.0f}) {
    const V e = k == 1.0f ? hn::Neg(one) : fourth;
    const V s = hn::Mul(e, k == 1.0f ? sine : hn::Mul(Set(2.0f), hn::Mul(sine, cosine)));
    const V c = hn::Mul(e, k == 1.0f ? cosine : hn::MulSub(hn::Mul(Set(2.0f), cosine), cosine, Set(1.0f)));
    const V factor = hn::MulAdd(Set(4.0f), variance, Set(1.0f / (kPi * kPi * k * k)));
    moved = hn::MulAdd(Set(1.0f / (kPi * k)), s, moved);
    spread = hn::MulAdd(c, factor, spread);
    c_by_c = hn::MulAdd(Set(2.0f), c, c_by_c);
    c_by_v = hn::MulAdd(Set(-2.0f * kPi * k), s, c_by_v);
    v_by_c = hn::MulAdd(Set(-2.0f * kPi * k), hn::Mul(s, factor), v_by_c);
    v_by_v = hn::MulAdd(c, hn::MulAdd(Set(-8.0f * kPi * kPi * k * k), variance, Set(2.0f)), v_by_v);
  }
  const V twice = hn::Add(moved, moved);
  return {.centre = moved,
          .variance = hn::NegMulAdd(moved, moved, spread),
          .centre_by_centre = c_by_c,
          .centre_by_variance = c_by_v,
          .variance_by_centre = hn::NegMulAdd(twice, c_by_c, v_by_c),
          .variance_by_variance = hn::NegMulAdd(twice, c_by_v, v_by_v)};
}

// `offset`: of the centre from `middle`, the middle of some pixel, lane by lane. The result's centre is from
// the footprint's own.
HWY_INLINE SeenLane SeenThroughPixels(V offset, V variance) {
  const D d;
  constexpr float kWide = 0.7f, kWaves = 0.1f;  // px^2
  const V zero = hn::Zero(d), one = Set(1.0f);
  SeenLane seen{zero, variance, one, zero, zero, one};
  const auto wide = hn::Gt(variance, Set(kWide));
  if (hn::AllTrue(d, wide)) return seen;
  const V place = hn::Sub(offset, hn::Round(offset));
  SeenLane waves = SeenFromWaves(place, variance);
  const auto narrow = hn::Lt(variance, Set(kWaves));
  const auto mix = [&](auto mask, const SeenLane& yes, const SeenLane& no) {
    return SeenLane{hn::IfThenElse(mask, yes.centre, no.centre),
                    hn::IfThenElse(mask, yes.variance, no.variance),
                    hn::IfThenElse(mask, yes.centre_by_centre, no.centre_by_centre),
                    hn::IfThenElse(mask, yes.centre_by_variance, no.centre_by_variance),
                    hn::IfThenElse(mask, yes.variance_by_centre, no.variance_by_centre),
                    hn::IfThenElse(mask, yes.variance_by_variance, no.variance_by_variance)};
  };
  if (!hn::AllFalse(d, narrow)) waves = mix(narrow, SeenFromEdges(place, variance), waves);
  return mix(wide, seen, waves);
}

// The lit part of a footprint not clipped by an edge of the monitor, and its derivatives.
struct LitLane {
  V share, by_centre, by_variance;
};

// `place`: of the centre, in bars from where a lit one begins. For sigma up to 0.36 bars: by the four edges
// around it, core/footprint/lit_area.h.
HWY_INLINE LitLane LitFromEdges(V place, V sigma, float bar_px) {
  const D d;
  const V zero = hn::Zero(d), whole = hn::Floor(place), inside = hn::Sub(place, whole);
  const auto lit =
      hn::Lt(hn::Abs(hn::NegMulAdd(Set(2.0f), hn::Floor(hn::Mul(Set(0.5f), whole)), whole)), Set(0.5f));
  const V sign = hn::IfThenElse(lit, Set(1.0f), Set(-1.0f));
  const V inverse = hn::Div(Set(1.0f), sigma), scale = hn::Mul(Set(bar_px), inverse);
  V share = zero, by_c = zero, by_v = zero;
  float own = -1.0f;
  for (const float edge : {-1.0f, 0.0f, 1.0f, 2.0f}) {
    const V z = hn::Mul(hn::Sub(Set(edge), inside), scale);
    V density;
    const V beyond = Beyond(z, density);
    share = hn::MulAdd(Set(own), beyond, share);
    by_c = hn::MulAdd(Set(own), density, by_c);
    by_v = hn::MulAdd(hn::Mul(Set(own), density), z, by_v);
    own = -own;
  }
  by_c = hn::Mul(by_c, inverse);
  by_v = hn::Mul(by_v, hn::Mul(Set(0.5f), hn::Mul(inverse, inverse)));
  return {hn::MulAdd(sign, share, hn::IfThenElseZero(lit, Set(1.0f))), hn::Mul(sign, by_c),
          hn::Mul(sign, by_v)};
}

// By the first and the third harmonic; for sigma from 0.34 bars.
HWY_INLINE LitLane LitFromWaves(V place, V variance, float bar_px) {
  const D d;
  const V angle = hn::Mul(Set(kPi), hn::NegMulAdd(Set(2.0f), hn::Round(hn::Mul(Set(0.5f), place)), place));
  const V sine = hn::Sin(d, angle), cosine = hn::Cos(d, angle);
  const float first = kPi / bar_px;
  const V exponent = hn::Mul(Set(-0.5f * first * first), variance), least = Set(-9.5f);
  const V one = hn::IfThenElseZero(hn::Gt(exponent, least), hn::Exp(d, hn::Max(exponent, least)));
  const V second = hn::Mul(one, one), fourth = hn::Mul(second, second),
          ninth = hn::Mul(hn::Mul(fourth, fourth), one);
  const V s3 = hn::Mul(sine, hn::NegMulAdd(hn::Mul(Set(4.0f), sine), sine, Set(3.0f))),
          c3 = hn::Mul(cosine, hn::MulSub(hn::Mul(Set(4.0f), cosine), cosine, Set(3.0f)));
  const V a = hn::Mul(sine, one), b = hn::Mul(s3, ninth);
  const V by_c = hn::Mul(Set(2.0f / bar_px), hn::MulAdd(cosine, one, hn::Mul(c3, ninth)));
  return {hn::MulAdd(Set(2.0f / kPi), hn::MulAdd(Set(1.0f / 3.0f), b, a), Set(0.5f)), by_c,
          hn::Mul(Set(-kPi / (bar_px * bar_px)), hn::MulAdd(Set(3.0f), b, a))};
}

HWY_INLINE LitLane LitByBars(V place, V variance, float bar_px) {
  const D d;
  const V sigma = hn::Sqrt(hn::Max(variance, Set(1e-4f)));
  const auto edges = hn::Lt(sigma, Set(0.35f * bar_px));
  if (hn::AllTrue(d, edges)) return LitFromEdges(place, sigma, bar_px);
  const LitLane waves = LitFromWaves(place, variance, bar_px);
  if (hn::AllFalse(d, edges)) return waves;
  const LitLane sharp = LitFromEdges(place, sigma, bar_px);
  return {hn::IfThenElse(edges, sharp.share, waves.share),
          hn::IfThenElse(edges, sharp.by_centre, waves.by_centre),
          hn::IfThenElse(edges, sharp.by_variance, waves.by_variance)};
}

// lit_share_error of core/footprint/lit_area.h, for footprints not clipped by an edge.
HWY_INLINE V LitShareError(V variance, float bar_px) {
  const D d;
  const V sigma = hn::Sqrt(hn::Max(variance, Set(1e-4f)));
  const V angle = hn::Mul(Set(0.5f * kPi / bar_px), sigma),
          box = hn::Max(hn::Mul(Set(3.4641016f), angle), Set(1e-3f));
  const V of_box = hn::Div(hn::Sin(d, hn::Min(box, Set(8.0f))), box);
  const V of_gaussian = hn::Exp(d, hn::Max(hn::Mul(Set(-2.0f), hn::Mul(angle, angle)), Set(-80.0f)));
  const V error = hn::Mul(Set(2.0f / kPi), hn::Abs(hn::Sub(of_gaussian, of_box)));
  return hn::IfThenElse(hn::Gt(sigma, Set(1.4f * bar_px)), hn::Zero(d), error);
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#endif
