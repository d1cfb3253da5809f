#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/mixture/cut_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/footprint/faddeeva.h"
#include "core/footprint/gauss_legendre.h"
#include "solver/mixture/pattern_lanes.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, PatternLanes::kPad>;
using V = hn::Vec<D>;
constexpr double kSqrt2 = std::numbers::sqrt2, kTau = 2.0 * std::numbers::pi;

HWY_INLINE V set(double value) {
  return hn::Set(D(), static_cast<float>(value));
}

struct Complex {
  V re, im;
};
HWY_INLINE Complex operator+(const Complex& a, const Complex& b) {
  return {hn::Add(a.re, b.re), hn::Add(a.im, b.im)};
}
HWY_INLINE Complex operator-(const Complex& a, const Complex& b) {
  return {hn::Sub(a.re, b.re), hn::Sub(a.im, b.im)};
}
HWY_INLINE Complex operator*(const Complex& a, const Complex& b) {
  return {hn::NegMulAdd(a.im, b.im, hn::Mul(a.re, b.re)), hn::MulAdd(a.re, b.im, hn::Mul(a.im, b.re))};
}
HWY_INLINE Complex operator*(V a, const Complex& b) {
  return {hn::Mul(a, b.re), hn::Mul(a, b.im)};
}
HWY_INLINE Complex zero() {
  return {hn::Zero(D()), hn::Zero(D())};
}
// i omega z.
HWY_INLINE Complex turned(V omega, const Complex& z) {
  return {hn::Neg(hn::Mul(omega, z.im)), hn::Mul(omega, z.re)};
}
HWY_INLINE V fall(V exponent) {
  return hn::Exp(D(), hn::Max(exponent, set(-80.0)));
}

// Frequencies along x and y, of which a share of each is used: exact far from 0.
struct Frequencies {
  const double *fx, *fy;
  size_t k;

  // exp(2 pi i (x fx + y fy)).
  HWY_INLINE Complex wave(double x, double y) const {
    const V angle = hn::Mul(part(x, y), set(kTau));
    return {hn::Cos(D(), angle), hn::Sin(D(), angle)};
  }
  HWY_INLINE V part(double x, double y) const {
#if HWY_TARGET == HWY_SCALAR
    const double turns = fx[k] * x + fy[k] * y;
    return set(turns - std::nearbyint(turns));
#else
    const hn::Half<D> half;
    const hn::Rebind<double, hn::Half<D> > wide;
    const auto at = [&](size_t i) HWY_ATTR {
      const auto turns = hn::MulAdd(hn::LoadU(wide, fx + i), hn::Set(wide, x),
                                    hn::Mul(hn::LoadU(wide, fy + i), hn::Set(wide, y)));
      return hn::DemoteTo(half, hn::Sub(turns, hn::Round(turns)));
    };
    return hn::Combine(D(), at(k + hn::Lanes(half)), at(k));
#endif
  }
};

// faddeeva.h, of v + i u with u >= 0.
HWY_INLINE Complex faddeeva_of(V v, double u) {
  const FaddeevaSeries& series = faddeeva_series();
  const V scale = set(series.scale), up = set(u), one = set(1.0);
  // 1 / (L - iz) and Z = (L + iz) / (L - iz), with iz = -u + i v.
  const V low = hn::Add(scale, up), norm = hn::Div(one, hn::MulAdd(low, low, hn::Mul(v, v)));
  const Complex inverse{hn::Mul(low, norm), hn::Mul(v, norm)};
  const Complex z = Complex{hn::Sub(scale, up), v} * inverse;
  Complex sum = zero();
  for (size_t n = series.coefficients.size(); n-- > 0;) {
    sum = sum * z;
    sum.re = hn::Add(sum.re, set(series.coefficients[n]));
  }
  return set(2.0) * (sum * (inverse * inverse)) + set(std::numbers::inv_sqrtpi) * inverse;
}

// A normal density of one coordinate, and the monitor's edges across it (wave_answer.cpp).
struct NormalLine {
  double mean, sd, size_px;

  double density(double t) const {
    const double z = (t - mean) / sd;
    return std::exp(-0.5 * z * z) / (sd * std::sqrt(kTau));
  }
  bool cut() const { return mean < 5.0 * sd || size_px - mean < 5.0 * sd; }
  // int density exp(i omega t) dt over the monitor; `low`, `high`: exp(i omega t) at its edges, `middle`: at
  // the mean.
  HWY_INLINE Complex waved(V omega, const Complex& at_low, const Complex& at_high,
                           const Complex& middle) const {
    const V v = hn::Mul(omega, set(sd / kSqrt2));
    const auto tail = [&](double edge, const Complex& of_edge) HWY_ATTR {
      const double u = (edge - mean) / (sd * kSqrt2);
      if (std::abs(u) > 4.0) return zero();
      Complex w = faddeeva_of(v, std::abs(u));
      if (u < 0.0) w.im = hn::Neg(w.im);
      return set(0.5 * std::exp(-u * u)) * (of_edge * w);
    };
    const Complex low = tail(0.0, at_low), high = tail(size_px, at_high);
    if (mean < 0.0) return low - high;
    if (mean > size_px) return high - low;
    return fall(hn::Neg(hn::Mul(v, v))) * middle - low - high;
  }
};

struct Edges {
  std::array<Complex, 2> x, y;
  std::array<std::array<Complex, 2>, 2> corner;
  HWY_INLINE Complex corners() const { return corner[1][1] - corner[1][0] - corner[0][1] + corner[0][0]; }
};

const GaussLegendre<8> kFew;
const GaussLegendre<12> kMore;

class CutWaves {
 public:
  HWY_INLINE CutWaves(const internal::WaveLanes& lanes, const Footprint& mode, const MonitorExtent& extent,
                      size_t k)
      : frequencies_{lanes.by_x, lanes.by_y, k},
        wx_(hn::Neg(hn::LoadU(D(), lanes.fx + k))),
        wy_(hn::Neg(hn::LoadU(D(), lanes.fy + k))),
        x_{.mean = mode.x_px, .sd = std::sqrt(std::max(mode.xx_px2, 0.01)), .size_px = extent.width_px},
        y_{.mean = mode.y_px, .sd = std::sqrt(std::max(mode.yy_px2, 0.01)), .size_px = extent.height_px},
        of_x_{frequencies_.wave(0.0, 0.0), frequencies_.wave(extent.width_px, 0.0)},
        of_y_{frequencies_.wave(0.0, 0.0), frequencies_.wave(0.0, extent.height_px)},
        xy_(std::clamp(mode.xy_px2, -0.999 * x_.sd * y_.sd, 0.999 * x_.sd * y_.sd)) {}

  // WaveAnswer of weight 1, without sinc.
  struct Answer {
    Complex value;
    std::array<Complex, 6> slope;
  };
  HWY_INLINE Answer answer() const {
    const Edges edges = edges_at(xy_);
    const Complex inside = integral();
    const Complex along_x = edges.x[1] - edges.x[0], along_y = edges.y[1] - edges.y[0];
    const double xx = x_.sd * x_.sd, yy = y_.sd * y_.sd;
    Complex by_x = zero(), by_y = zero();
    for (size_t i = 0; i < 2; ++i) {
      const double sign = i == 0 ? -1.0 : 1.0;
      const double dx = (i == 0 ? 0.0 : x_.size_px) - x_.mean, dy = (i == 0 ? 0.0 : y_.size_px) - y_.mean;
      by_x = by_x + set(-sign * dx / xx) * edges.x[i] +
             set(sign * xy_ / xx) * (turned(wy_, edges.x[i]) - (edges.corner[i][1] - edges.corner[i][0]));
      by_y = by_y + set(-sign * dy / yy) * edges.y[i] +
             set(sign * xy_ / yy) * (turned(wx_, edges.y[i]) - (edges.corner[1][i] - edges.corner[0][i]));
    }
    const V half = set(0.5);
    return {
        .value = inside,
        .slope = {
            set(-1.0 / 12.0) * (turned(wx_, along_x) + turned(wy_, along_y)), turned(wx_, inside) - along_x,
            turned(wy_, inside) - along_y, half * (by_x - turned(wx_, along_x - turned(wx_, inside))),
            edges.corners() - turned(wy_, along_x) - turned(wx_, along_y) + turned(wx_, turned(wy_, inside)),
            half * (by_y - turned(wy_, along_y - turned(wy_, inside)))}};
  }

 private:
  HWY_INLINE Edges edges_at(double xy) const {
    constexpr double kNoLight = 5.5;
    Edges edges{
        .x = {zero(), zero()}, .y = {zero(), zero()}, .corner = {{{zero(), zero()}, {zero(), zero()}}}};
    const double xx = x_.sd * x_.sd, yy = y_.sd * y_.sd;
    for (size_t i = 0; i < 2; ++i) {
      const double at_x = i == 0 ? 0.0 : x_.size_px, at_y = i == 0 ? 0.0 : y_.size_px;
      if (std::abs(at_y - y_.mean) < kNoLight * y_.sd) {
        const NormalLine along{.mean = x_.mean + xy / yy * (at_y - y_.mean),
                               .sd = std::sqrt(xx - xy * xy / yy),
                               .size_px = x_.size_px};
        edges.y[i] = set(y_.density(at_y)) *
                     (of_y_[i] * along.waved(wx_, of_x_[0], of_x_[1], frequencies_.wave(along.mean, 0.0)));
      }
      if (std::abs(at_x - x_.mean) >= kNoLight * x_.sd) continue;
      const NormalLine along{.mean = y_.mean + xy / xx * (at_x - x_.mean),
                             .sd = std::sqrt(yy - xy * xy / xx),
                             .size_px = y_.size_px};
      const Complex here = set(x_.density(at_x)) * of_x_[i];
      edges.x[i] = here * along.waved(wy_, of_y_[0], of_y_[1], frequencies_.wave(0.0, along.mean));
      for (size_t j = 0; j < 2; ++j)
        edges.corner[i][j] = set(along.density(j == 0 ? 0.0 : y_.size_px)) * (here * of_y_[j]);
    }
    return edges;
  }

  HWY_INLINE Complex integral() const {
    const double xx = x_.sd * x_.sd, yy = y_.sd * y_.sd;
    if (!y_.cut()) {
      const double turn = xy_ / xx, rest = yy - xy_ * turn;
      const Complex whole = x_.waved(hn::MulAdd(wy_, set(turn), wx_), of_x_[0],
                                     frequencies_.wave(x_.size_px, turn * x_.size_px),
                                     frequencies_.wave(x_.mean, turn * x_.mean));
      return fall(hn::Mul(hn::Mul(wy_, wy_), set(-0.5 * rest))) *
             (whole * frequencies_.wave(0.0, y_.mean - turn * x_.mean));
    }
    if (!x_.cut()) {
      const double turn = xy_ / yy, rest = xx - xy_ * turn;
      const Complex whole = y_.waved(hn::MulAdd(wx_, set(turn), wy_), of_y_[0],
                                     frequencies_.wave(turn * y_.size_px, y_.size_px),
                                     frequencies_.wave(turn * y_.mean, y_.mean));
      return fall(hn::Mul(hn::Mul(wx_, wx_), set(-0.5 * rest))) *
             (whole * frequencies_.wave(x_.mean - turn * y_.mean, 0.0));
    }
    const double correlation = xy_ / (x_.sd * y_.sd);
    const Complex apart = x_.waved(wx_, of_x_[0], of_x_[1], frequencies_.wave(x_.mean, 0.0)) *
                          y_.waved(wy_, of_y_[0], of_y_[1], frequencies_.wave(0.0, y_.mean));
    const V pull = hn::Mul(wx_, wy_);
    const Complex upright = hn::Exp(D(), hn::Clamp(hn::Mul(pull, set(-xy_)), set(-80.0), set(80.0))) * apart;
    return upright + (std::abs(correlation) > 0.9 ? turned_to(correlation, pull, kMore)
                                                  : turned_to(correlation, pull, kFew));
  }

  // The contribution of a correlation, by Plackett's identity.
  template <size_t N>
  HWY_INLINE Complex turned_to(double correlation, V pull, const GaussLegendre<N>& nodes) const {
    const double most = x_.sd * y_.sd, angle = std::asin(correlation);
    Complex sum = zero();
    for (size_t n = 0; n < N && angle != 0.0; ++n) {
      const double theta = 0.5 * angle * (1.0 + nodes.place[n]), xy = most * std::sin(theta);
      const Edges edges = edges_at(xy);
      const Complex slope =
          edges.corners() - turned(wy_, edges.x[1] - edges.x[0]) - turned(wx_, edges.y[1] - edges.y[0]);
      const V growth = hn::Exp(D(), hn::Clamp(hn::Mul(pull, set(xy - xy_)), set(-80.0), set(80.0)));
      sum = sum + hn::Mul(set(0.5 * angle * nodes.weight[n] * most * std::cos(theta)), growth) * slope;
    }
    return sum;
  }

  const Frequencies frequencies_;
  const V wx_, wy_;
  const NormalLine x_, y_;
  const std::array<Complex, 2> of_x_, of_y_;
  const double xy_;
};

// Columns of lanes k and on: half of the level, and half of the visible part of a wave.
HWY_INLINE void put(const std::array<V, 6>& wave, double weight, const NormalShare& level, V scale,
                    size_t size, float* columns) {
  const D d;
  const std::array<double, 6> by{level.share, level.by_x, level.by_y, level.by_xx, level.by_xy, level.by_yy};
  const V half = set(0.5), scaled = hn::Mul(scale, set(weight));
  for (size_t p = 0; p < 6; ++p) {
    const V own = hn::Mul(half, hn::Add(wave[p], set(by[p])));
    hn::StoreU(hn::Mul(p == 0 ? scale : scaled, own), d, columns + (p + 1) * size);
    if (p == 0) hn::StoreU(hn::Mul(scaled, own), d, columns);
  }
}

}  // namespace

void AnswerCutWaves(const internal::WaveLanes& lanes, const Footprint& mode, const MonitorExtent& extent,
                    const NormalShare& level, size_t end, size_t size, const float* scale, float* columns) {
  const D d;
  for (size_t k = 0; k < end; k += hn::Lanes(d)) {
    const CutWaves::Answer own = CutWaves(lanes, mode, extent, k).answer();
    const V angle = hn::Mul(set(kTau), Frequencies{lanes.from, lanes.from, k}.part(1.0, 0.0));
    const V cosine = hn::Cos(d, angle), sine = hn::Sin(d, angle);
    const V flat = hn::Mul(set(2.0), hn::LoadU(d, lanes.height + k));  // sinc(fx) sinc(fy)
    const auto seen = [&](const Complex& z)
                          HWY_ATTR { return hn::MulAdd(z.re, cosine, hn::Mul(z.im, sine)); };
    std::array<V, 6> wave;
    wave[0] = hn::MulAdd(flat, seen(own.value), seen(own.slope[0]));
    for (size_t p = 1; p < 6; ++p) wave[p] = hn::Mul(flat, seen(own.slope[p]));
    put(wave, mode.weight, level, hn::LoadU(d, scale + k), size, columns + k);
  }
}

void AnswerReachedWaves(const internal::WaveLanes& lanes, double weight, std::span<const ReachedPixel> pixels,
                        const NormalShare& level, size_t end, size_t size, const float* scale,
                        float* columns) {
  const D d;
  for (size_t k = 0; k < end; k += hn::Lanes(d)) {
    const Frequencies frequencies{lanes.by_x, lanes.by_y, k};
    const V from = Frequencies{lanes.from, lanes.from, k}.part(1.0, 0.0);
    std::array<V, 6> wave;
    wave.fill(hn::Zero(d));
    for (const ReachedPixel& pixel : pixels) {
      const NormalShare& part = pixel.part;
      const V light = hn::Cos(d, hn::Mul(set(kTau), hn::Sub(frequencies.part(pixel.x_px, pixel.y_px), from)));
      const std::array<double, 6> by{part.share, part.by_x, part.by_y, part.by_xx, part.by_xy, part.by_yy};
      for (size_t p = 0; p < 6; ++p) wave[p] = hn::MulAdd(set(by[p]), light, wave[p]);
    }
    put(wave, weight, level, hn::LoadU(d, scale + k), size, columns + k);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing::internal {

HWY_EXPORT(AnswerCutWaves);
HWY_EXPORT(AnswerReachedWaves);

void answer_cut_waves(const WaveLanes& lanes, const Footprint& mode, const MonitorExtent& extent,
                      const NormalShare& level, size_t end, size_t size, const float* scale, float* columns) {
  HWY_DYNAMIC_DISPATCH(AnswerCutWaves)(lanes, mode, extent, level, end, size, scale, columns);
}

void answer_reached_waves(const WaveLanes& lanes, double weight, std::span<const ReachedPixel> pixels,
                          const NormalShare& level, size_t end, size_t size, const float* scale,
                          float* columns) {
  HWY_DYNAMIC_DISPATCH(AnswerReachedWaves)(lanes, weight, pixels, level, end, size, scale, columns);
}

}  // namespace glasswing::internal
#endif
