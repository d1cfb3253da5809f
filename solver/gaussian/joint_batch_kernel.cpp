#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/joint_batch_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <algorithm>
#include <cmath>
#include <vector>

#include "solver/gaussian/joint_batch.h"
#include "solver/gaussian/line_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

using Row = float[kMostLanes];

// One sweep of a batch of pixels.
struct BatchSweep {
  int half = 0;
  bool even = true;            // all lanes have that many samples
  std::vector<float> samples;  // [k + half][lane]
  HWY_ALIGN Row own_half;
  HWY_ALIGN Row offset;  // of the start's centre from the middle sample, in samples
};

void GatherPlain(std::span<const PlainPixel> pixels, std::span<const PlainFit> starts, const EvenSweep& sweep,
                 size_t s, BatchSweep& batch) {
  const size_t lanes = hn::Lanes(D());
  batch.half = 0;
  batch.even = true;
  for (const PlainPixel& pixel : pixels) {
    batch.half = std::max(batch.half, pixel.windows[s].half);
    batch.even = batch.even && pixel.windows[s].half == pixels.front().windows[s].half;
  }
  batch.samples.resize(static_cast<size_t>(2 * batch.half + 1) * lanes);
  for (size_t lane = 0; lane < lanes; ++lane) {
    const size_t i = std::min(lane, pixels.size() - 1);
    const LineWindow& window = pixels[i].windows[s];
    const Footprint& start = starts[i].mode;
    batch.own_half[lane] = static_cast<float>(window.half);
    batch.offset[lane] = static_cast<float>(
        (start.x_px * sweep.axis.cos_phi + start.y_px * sweep.axis.sin_phi - pixels[i].middle_r_px[s]) /
        sweep.step_px);
    float* to = batch.samples.data() + static_cast<size_t>(batch.half - window.half) * lanes + lane;
    const float* from = window.middle - window.half * window.stride;
    for (int k = -window.half; k <= window.half; ++k, to += lanes, from += window.stride) *to = *from;
  }
}

template <bool kEven>
void PlainSums(const BatchSweep& batch, V a, V mu, V sigma, Moments& sums, V& chi2) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  const float* middle = batch.samples.data() + batch.half * lanes;
  Shape shape = Begin(mu, sigma);
  const V own_half = hn::Load(d, batch.own_half);
  V r = hn::NegMulAdd(a, shape.up.g, hn::LoadU(d, middle));
  chi2 = hn::MulAdd(r, r, chi2);
  sums.m0 = hn::Mul(r, shape.up.g);
  sums.m1 = sums.m2 = hn::Zero(d);
  V down_chi2 = hn::Zero(d);
  Moments down{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  V k = Set(1.0f);
  for (int i = 1; i <= batch.half; ++i) {
    Step(shape.up, shape.ratio);
    Step(shape.down, shape.ratio);
    r = hn::NegMulAdd(a, shape.up.g, hn::LoadU(d, middle + i * lanes));
    V s = hn::NegMulAdd(a, shape.down.g, hn::LoadU(d, middle - i * lanes));
    if constexpr (!kEven) {
      const auto within = hn::Le(k, own_half);
      r = hn::IfThenElseZero(within, r);
      s = hn::IfThenElseZero(within, s);
    }
    chi2 = hn::MulAdd(r, r, chi2);
    down_chi2 = hn::MulAdd(s, s, down_chi2);
    sums.Add(hn::Mul(r, shape.up.g), k);
    down.Add(hn::Mul(s, shape.down.g), k);
    k = hn::Add(k, Set(1.0f));
  }
  chi2 = hn::Add(chi2, down_chi2);
  sums.m0 = hn::Add(sums.m0, down.m0);
  sums.m1 = hn::Sub(sums.m1, down.m1);
  sums.m2 = hn::Add(sums.m2, down.m2);
}

// The 4 x 4 system of R and Sigma, lower triangle packed by rows: solved in place by Cholesky. `first` gets
// the first element of the inverse's diagonal.
void SolveFour(Row* m, Row* x, float* first) {
  const D d;
  const auto at = [&](int i, int j) -> float* { return m[i * (i + 1) / 2 + j]; };
  for (int j = 0; j < 4; ++j) {
    V diagonal = hn::Load(d, at(j, j));
    const V least = hn::MulAdd(diagonal, Set(1e-6f), Set(1e-30f));
    for (int k = 0; k < j; ++k)
      diagonal = hn::NegMulAdd(hn::Load(d, at(j, k)), hn::Load(d, at(j, k)), diagonal);
    const V inverse = hn::Div(Set(1.0f), hn::Sqrt(hn::Max(diagonal, least)));
    hn::Store(inverse, d, at(j, j));
    for (int i = j + 1; i < 4; ++i) {
      V sum = hn::Load(d, at(i, j));
      for (int k = 0; k < j; ++k) sum = hn::NegMulAdd(hn::Load(d, at(i, k)), hn::Load(d, at(j, k)), sum);
      hn::Store(hn::Mul(sum, inverse), d, at(i, j));
    }
  }
  for (int i = 0; i < 4; ++i) {
    V sum = hn::Load(d, x[i]);
    for (int k = 0; k < i; ++k) sum = hn::NegMulAdd(hn::Load(d, at(i, k)), hn::Load(d, x[k]), sum);
    hn::Store(hn::Mul(sum, hn::Load(d, at(i, i))), d, x[i]);
  }
  for (int i = 3; i >= 0; --i) {
    V sum = hn::Load(d, x[i]);
    for (int k = i + 1; k < 4; ++k) sum = hn::NegMulAdd(hn::Load(d, at(k, i)), hn::Load(d, x[k]), sum);
    hn::Store(hn::Mul(sum, hn::Load(d, at(i, i))), d, x[i]);
  }
  // |L^-1 e_0|^2
  V column[4] = {hn::Load(d, at(0, 0)), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  V sum = hn::Mul(column[0], column[0]);
  for (int i = 1; i < 4; ++i) {
    V value = hn::Zero(d);
    for (int k = 0; k < i; ++k) value = hn::NegMulAdd(hn::Load(d, at(i, k)), column[k], value);
    column[i] = hn::Mul(value, hn::Load(d, at(i, i)));
    sum = hn::MulAdd(column[i], column[i], sum);
  }
  hn::Store(sum, d, first);
}

void FitBatch(std::span<const EvenSweep> sweeps, std::span<const PlainPixel> pixels, std::span<PlainFit> fits,
              std::vector<BatchSweep>& batches) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  for (size_t s = 0; s < sweeps.size(); ++s) GatherPlain(pixels, fits, sweeps[s], s, batches[s]);
  HWY_ALIGN Row p[6];  // R, and from the start's centre x, y; xx, xy, yy
  for (size_t lane = 0; lane < lanes; ++lane) {
    const Footprint& start = fits[std::min(lane, pixels.size() - 1)].mode;
    p[0][lane] = static_cast<float>(start.weight);
    p[1][lane] = p[2][lane] = 0.0f;
    p[3][lane] = static_cast<float>(start.xx_px2);
    p[4][lane] = static_cast<float>(start.xy_px2);
    p[5][lane] = static_cast<float>(start.yy_px2);
  }
  HWY_ALIGN Row matrix[10], step[4], weight_variance, out;
  V chi2 = hn::Zero(d), centre_variance = hn::Zero(d);
  auto settled = hn::Lt(Set(1.0f), hn::Zero(d));
  for (int iteration = 0; iteration < 10; ++iteration) {
    for (Row& row : matrix) hn::Store(hn::Zero(d), d, row);
    for (Row& row : step) hn::Store(hn::Zero(d), d, row);
    V nxx = hn::Zero(d), nxy = nxx, nyy = nxx, gx = nxx, gy = nxx, narrowest = Set(1e30f);
    chi2 = hn::Zero(d);
    const V weight = hn::Load(d, p[0]);
    for (size_t i = 0; i < sweeps.size(); ++i) {
      const auto c = static_cast<float>(sweeps[i].axis.cos_phi),
                 s = static_cast<float>(sweeps[i].axis.sin_phi);
      const auto step_px = static_cast<float>(sweeps[i].step_px),
                 sigma_s = static_cast<float>(sweeps[i].axis.sigma_px);
      const float square[3] = {c * c, 2.0f * c * s, s * s};
      V variance = Set(sigma_s * sigma_s + static_cast<float>(kFlatPixel_px2));
      for (int k = 0; k < 3; ++k) variance = hn::MulAdd(Set(square[k]), hn::Load(d, p[3 + k]), variance);
      variance = hn::Max(variance, Set(0.25f * sigma_s * sigma_s));
      const V sd_px = hn::Sqrt(variance), sigma = hn::Mul(sd_px, Set(1.0f / step_px));
      const V crest = hn::Div(Set(sigma_s), sd_px), amplitude = hn::Mul(weight, crest);
      const V mu =
          hn::MulAdd(Set(c / step_px), hn::Load(d, p[1]),
                     hn::MulAdd(Set(s / step_px), hn::Load(d, p[2]), hn::Load(d, batches[i].offset)));
      Moments sums;
      if (batches[i].even) {
        PlainSums<true>(batches[i], amplitude, mu, sigma, sums, chi2);
      } else {
        PlainSums<false>(batches[i], amplitude, mu, sigma, sums, chi2);
      }
      sums.ToUnits(mu, sigma);
      narrowest = hn::Min(narrowest, sd_px);
      const V w = hn::Div(sigma, Set(kInverseRootPi));
      const V by_place = hn::Div(amplitude, sd_px);  // dy/d(c.s) = by_place z g
      const V place = hn::Mul(hn::Mul(hn::Mul(by_place, by_place), w), Set(0.5f)),
              place_g = hn::Mul(by_place, sums.m1);
      nxx = hn::MulAdd(place, Set(c * c), nxx), nxy = hn::MulAdd(place, Set(c * s), nxy);
      nyy = hn::MulAdd(place, Set(s * s), nyy);
      gx = hn::MulAdd(place_g, Set(c), gx), gy = hn::MulAdd(place_g, Set(s), gy);
      const V by_variance = hn::Div(hn::Mul(Set(0.5f), amplitude), variance);
      const V rr = hn::Mul(hn::Mul(crest, crest), w);
      const V rv = hn::Mul(hn::Mul(hn::Mul(crest, by_variance), w), Set(-0.5f));
      const V vv = hn::Mul(hn::Mul(hn::Mul(by_variance, by_variance), w), Set(0.75f));
      const V variance_g = hn::Mul(by_variance, hn::Sub(sums.m2, sums.m0));
      const auto add = [&](Row& to, V value) { hn::Store(hn::Add(hn::Load(d, to), value), d, to); };
      add(matrix[0], rr);
      add(step[0], hn::Mul(crest, sums.m0));
      for (int k = 0; k < 3; ++k) {
        add(matrix[(k + 1) * (k + 2) / 2], hn::Mul(rv, Set(square[k])));
        for (int l = 0; l <= k; ++l)
          add(matrix[(k + 1) * (k + 2) / 2 + l + 1], hn::Mul(vv, Set(square[k] * square[l])));
        add(step[k + 1], hn::Mul(variance_g, Set(square[k])));
      }
    }
    const V determinant = hn::NegMulAdd(nxy, nxy, hn::Mul(nxx, nyy)),
            inverse = hn::Div(Set(1.0f), determinant);
    const V dx = hn::Mul(hn::NegMulAdd(nxy, gy, hn::Mul(nyy, gx)), inverse);
    const V dy = hn::Mul(hn::NegMulAdd(nxy, gx, hn::Mul(nxx, gy)), inverse);
    centre_variance = hn::Mul(hn::Mul(Set(0.5f), hn::Add(nxx, nyy)), inverse);
    SolveFour(matrix, step, weight_variance);
    const V limit = hn::Mul(Set(0.5f), narrowest), small = hn::Mul(Set(1e-3f), narrowest);
    const V wide = hn::Mul(narrowest, narrowest);
    settled = hn::And(hn::Le(hn::Abs(dx), small), hn::Le(hn::Abs(dy), small));
    settled = hn::And(settled, hn::Le(hn::Abs(hn::Load(d, step[0])), hn::Mul(Set(1e-3f), weight)));
    const auto clip = [](V value, V most) { return hn::Max(hn::Min(value, most), hn::Neg(most)); };
    hn::Store(hn::Add(weight, clip(hn::Load(d, step[0]), hn::Mul(Set(0.5f), weight))), d, p[0]);
    hn::Store(hn::Add(hn::Load(d, p[1]), clip(dx, limit)), d, p[1]);
    hn::Store(hn::Add(hn::Load(d, p[2]), clip(dy, limit)), d, p[2]);
    for (int k = 0; k < 3; ++k) {
      const V move = hn::Load(d, step[k + 1]);
      settled = hn::And(settled, hn::Le(hn::Abs(move), hn::Mul(Set(2e-3f), wide)));
      hn::Store(hn::Add(hn::Load(d, p[3 + k]), clip(move, wide)), d, p[3 + k]);
    }
    if (hn::AllTrue(d, settled)) break;
  }
  const V xx = hn::Load(d, p[3]), xy = hn::Load(d, p[4]), yy = hn::Load(d, p[5]);
  settled = hn::And(settled, hn::Gt(hn::Load(d, p[0]), hn::Zero(d)));
  settled = hn::And(settled, hn::And(hn::Gt(xx, hn::Zero(d)), hn::Gt(hn::Mul(xx, yy), hn::Mul(xy, xy))));
  HWY_ALIGN Row chi, centre;
  hn::Store(hn::IfThenElseZero(settled, Set(1.0f)), d, out);
  hn::Store(chi2, d, chi), hn::Store(centre_variance, d, centre);
  for (size_t lane = 0; lane < pixels.size(); ++lane) {
    PlainFit& fit = fits[lane];
    fit.chi2 = static_cast<double>(chi[lane]);
    fit.settled = out[lane] > 0.0f;
    fit.sample_count = 0;
    for (size_t s = 0; s < sweeps.size(); ++s) fit.sample_count += 2 * pixels[lane].windows[s].half + 1;
    if (!fit.settled) continue;
    fit.weight_sd = std::sqrt(static_cast<double>(weight_variance[lane]));
    fit.centre_sd_px = std::sqrt(static_cast<double>(centre[lane]));
    fit.mode.weight = static_cast<double>(p[0][lane]);
    fit.mode.x_px += static_cast<double>(p[1][lane]);
    fit.mode.y_px += static_cast<double>(p[2][lane]);
    fit.mode.xx_px2 = static_cast<double>(p[3][lane]);
    fit.mode.xy_px2 = static_cast<double>(p[4][lane]);
    fit.mode.yy_px2 = static_cast<double>(p[5][lane]);
  }
}

void FitPlain(std::span<const EvenSweep> sweeps, std::span<const PlainPixel> pixels,
              std::span<PlainFit> fits) {
  static thread_local std::vector<BatchSweep> batches(PlainPixel::kMostSweeps);
  const size_t lanes = hn::Lanes(D());
  for (size_t first = 0; first < pixels.size(); first += lanes) {
    const size_t count = std::min(lanes, pixels.size() - first);
    FitBatch(sweeps, pixels.subspan(first, count), fits.subspan(first, count), batches);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(FitPlain);

void fit_plain(std::span<const EvenSweep> sweeps, std::span<const PlainPixel> pixels,
               std::span<PlainFit> fits) {
  HWY_DYNAMIC_DISPATCH(FitPlain)(sweeps, pixels, fits);
}

}  // namespace glasswing
#endif
