#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "solver/gaussian/kernels/line_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <algorithm>
#include <memory>
#include <vector>

#include "solver/gaussian/kernels/line_fit.h"
#include "solver/gaussian/kernels/line_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

// A batch's samples, [k + half][lane].
struct Batch {
  int half = 0;
  bool even = true;  // all windows have this half
  HWY_ALIGN float samples[(2 * kMaxHalf + 1) * kMaxLanes];
  HWY_ALIGN float own_half[kMaxLanes];
};

void Gather(std::span<const LineWindow> windows, Batch& batch) {
  const auto lanes = static_cast<int>(hn::Lanes(D()));
  batch.half = 0;
  batch.even = true;
  for (const LineWindow& window : windows) {
    batch.half = std::max(batch.half, window.half);
    batch.even = batch.even && window.half == windows.front().half;
  }
  for (int lane = 0; lane < lanes; ++lane) {
    // Lanes without a window repeat the last one.
    const LineWindow& window = windows[std::min(static_cast<size_t>(lane), windows.size() - 1)];
    batch.own_half[lane] = static_cast<float>(window.half);
    float* to = batch.samples + batch.half * lanes + lane;
    for (int k = -batch.half; k <= batch.half; ++k) {
      to[k * lanes] = std::abs(k) <= window.half ? window.middle[k * window.stride] : 0.0f;
    }
  }
}

template <bool kEven>
void SingleSums(const Batch& batch, V a, V mu, V sigma, Moments& sums, V& chi2) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  const float* middle = batch.samples + batch.half * lanes;
  Shape shape = Begin(mu, sigma);
  const V own_half = hn::Load(d, batch.own_half);
  V r = hn::NegMulAdd(a, shape.up.g, hn::Load(d, middle));
  chi2 = hn::Mul(r, r);
  sums.m0 = hn::Mul(r, shape.up.g);
  sums.m1 = sums.m2 = hn::Zero(d);
  V down_chi2 = hn::Zero(d);
  Moments down{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  V k = Set(1.0f);
  for (int i = 1; i <= batch.half; ++i) {
    Step(shape.up, shape.ratio);
    Step(shape.down, shape.ratio);
    r = hn::NegMulAdd(a, shape.up.g, hn::Load(d, middle + i * lanes));
    V s = hn::NegMulAdd(a, shape.down.g, hn::Load(d, middle - i * lanes));
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

constexpr float kSettled = 1e-3f;  // as a share of sigma and of the amplitude

void FitSingle(std::span<const LineWindow> windows, std::span<SingleFit> fits) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  // Not thread-local: half a megabyte of thread-local storage overflows the small stacks of other libraries'
  // threads.
  static thread_local const std::unique_ptr<Batch> kept = std::make_unique<Batch>();
  Batch& batch = *kept;
  HWY_ALIGN float in[3][kMaxLanes], out[5][kMaxLanes];
  for (size_t first = 0; first < windows.size(); first += lanes) {
    const size_t count = std::min(lanes, windows.size() - first);
    Gather(windows.subspan(first, count), batch);
    for (size_t lane = 0; lane < lanes; ++lane) {
      const LineGaussian& start = fits[first + std::min(lane, count - 1)].peak;
      in[0][lane] = start.amplitude, in[1][lane] = start.centre, in[2][lane] = start.sigma;
    }
    V a = hn::Load(d, in[0]), mu = hn::Load(d, in[1]), sigma = hn::Load(d, in[2]);
    V chi2 = hn::Zero(d);
    auto settled = hn::Lt(sigma, hn::Zero(d));
    const V max_sigma = hn::Mul(hn::Load(d, batch.own_half), Set(3.0f));
    for (int iteration = 0; iteration < 12; ++iteration) {
      Moments sums;
      if (batch.even) {
        SingleSums<true>(batch, a, mu, sigma, sums, chi2);
      } else {
        SingleSums<false>(batch, a, mu, sigma, sums, chi2);
      }
      sums.ToUnits(mu, sigma);
      const V scale = hn::Div(Set(kInverseRootPi), sigma);
      const V da = hn::Mul(scale, hn::MulSub(Set(1.5f), sums.m0, sums.m2));
      const V per_a = hn::Mul(hn::Div(sigma, a), scale);
      const V dmu = hn::Mul(per_a, hn::Add(sums.m1, sums.m1));
      const V dsigma = hn::Mul(per_a, hn::MulSub(Set(2.0f), sums.m2, sums.m0));
      const V limit = hn::Mul(Set(0.5f), sigma);
      const V small = hn::Mul(Set(kSettled), sigma);
      settled = hn::And(hn::And(hn::Le(hn::Abs(dmu), small), hn::Le(hn::Abs(dsigma), small)),
                        hn::Le(hn::Abs(da), hn::Mul(Set(kSettled), hn::Abs(a))));
      a = hn::Add(a, da);
      mu = hn::Add(mu, hn::Max(hn::Min(dmu, limit), hn::Neg(limit)));
      sigma = hn::Add(sigma, hn::Max(hn::Min(dsigma, limit), hn::Neg(limit)));
      sigma = hn::Max(hn::Min(sigma, max_sigma), Set(0.5f));
      if (hn::AllTrue(d, settled)) break;
    }
    const V reach = hn::Load(d, batch.own_half);
    settled = hn::And(settled, hn::And(hn::Gt(a, hn::Zero(d)), hn::Le(hn::Abs(mu), reach)));
    hn::Store(a, d, out[0]), hn::Store(mu, d, out[1]), hn::Store(sigma, d, out[2]),
        hn::Store(chi2, d, out[3]);
    hn::Store(hn::IfThenElseZero(settled, Set(1.0f)), d, out[4]);
    for (size_t lane = 0; lane < count; ++lane) {
      SingleFit& fit = fits[first + lane];
      fit.chi2 = out[3][lane];
      fit.settled = out[4][lane] > 0.0f;
      if (fit.settled) fit.peak = {out[0][lane], out[1][lane], out[2][lane]};
    }
  }
}

void DoubleSums(const Batch& batch, const Row* p, Row* gradient, V& chi2) {
  const D d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  const float* middle = batch.samples + batch.half * lanes;
  const V a1 = hn::Load(d, p[0]), mu1 = hn::Load(d, p[1]), s1 = hn::Load(d, p[2]);
  const V a2 = hn::Load(d, p[3]), mu2 = hn::Load(d, p[4]), s2 = hn::Load(d, p[5]);
  const V own_half = hn::Load(d, batch.own_half);
  Shape one = Begin(mu1, s1), two = Begin(mu2, s2);
  V r = hn::NegMulAdd(a1, one.up.g, hn::NegMulAdd(a2, two.up.g, hn::Load(d, middle)));
  chi2 = hn::Mul(r, r);
  Moments m1{hn::Mul(r, one.up.g), hn::Zero(d), hn::Zero(d)},
      m2{hn::Mul(r, two.up.g), hn::Zero(d), hn::Zero(d)};
  V k = Set(1.0f);
  for (int i = 1; i <= batch.half; ++i) {
    const auto within = hn::Le(k, own_half);
    Step(one.up, one.ratio), Step(two.up, two.ratio), Step(one.down, one.ratio), Step(two.down, two.ratio);
    r = hn::NegMulAdd(a1, one.up.g, hn::NegMulAdd(a2, two.up.g, hn::Load(d, middle + i * lanes)));
    r = hn::IfThenElseZero(within, r);
    chi2 = hn::MulAdd(r, r, chi2);
    m1.Add(hn::Mul(r, one.up.g), k), m2.Add(hn::Mul(r, two.up.g), k);
    r = hn::NegMulAdd(a1, one.down.g, hn::NegMulAdd(a2, two.down.g, hn::Load(d, middle - i * lanes)));
    r = hn::IfThenElseZero(within, r);
    chi2 = hn::MulAdd(r, r, chi2);
    m1.Add(hn::Mul(r, one.down.g), hn::Neg(k)), m2.Add(hn::Mul(r, two.down.g), hn::Neg(k));
    k = hn::Add(k, Set(1.0f));
  }
  m1.ToUnits(mu1, s1), m2.ToUnits(mu2, s2);
  hn::Store(m1.m0, d, gradient[0]), hn::Store(m1.m1, d, gradient[1]), hn::Store(m1.m2, d, gradient[2]);
  hn::Store(m2.m0, d, gradient[3]), hn::Store(m2.m1, d, gradient[4]), hn::Store(m2.m2, d, gradient[5]);
}

// The basis' 6 x 6 Gram matrix, its lower triangle.
void DoubleGram(const Row* p, Row* gram) {
  const D d;
  const V zero = hn::Zero(d);
  for (int m = 0; m < 2; ++m) {
    const V sigma = hn::Load(d, p[3 * m + 2]);
    const V whole = hn::Div(sigma, Set(kInverseRootPi)), half = hn::Mul(Set(0.5f), whole);
    const auto put = [&](int i, int j, V value) { hn::Store(value, d, gram[Packed(3 * m + i, 3 * m + j)]); };
    put(0, 0, whole), put(1, 0, zero), put(1, 1, half);
    put(2, 0, half), put(2, 1, zero), put(2, 2, hn::Mul(Set(0.75f), whole));
  }
  // g1 g2 = C N(m, s^2): with k = m + s t, z1 = d1 + e1 t and z2 = d2 + e2 t.
  const V mu1 = hn::Load(d, p[1]), s1 = hn::Load(d, p[2]), mu2 = hn::Load(d, p[4]), s2 = hn::Load(d, p[5]);
  const V v1 = hn::Mul(s1, s1), v2 = hn::Mul(s2, s2), inverse = hn::Div(Set(1.0f), hn::Add(v1, v2));
  const V distance = hn::Sub(mu1, mu2);
  const V s = hn::Mul(hn::Mul(s1, s2), hn::Sqrt(inverse));
  const V mean = hn::Mul(hn::MulAdd(mu1, v2, hn::Mul(mu2, v1)), inverse);
  const V c = hn::Mul(hn::Mul(Set(2.5066283f), s),
                      hn::Exp(d, hn::Mul(Set(-0.5f), hn::Mul(hn::Mul(distance, distance), inverse))));
  const V d1 = hn::Div(hn::Sub(mean, mu1), s1), e1 = hn::Div(s, s1);
  const V d2 = hn::Div(hn::Sub(mean, mu2), s2), e2 = hn::Div(s, s2);
  const V d1d1 = hn::Mul(d1, d1), d2d2 = hn::Mul(d2, d2), e1e1 = hn::Mul(e1, e1), e2e2 = hn::Mul(e2, e2);
  const V e1e2 = hn::Mul(e1, e2), d1d2 = hn::Mul(d1, d2), z11 = hn::Add(d1d1, e1e1),
          z22 = hn::Add(d2d2, e2e2);
  const V two = Set(2.0f);
  const auto put = [&](int i, int j, V value) { hn::Store(hn::Mul(c, value), d, gram[Packed(3 + j, i)]); };
  put(0, 0, Set(1.0f)), put(0, 1, d2), put(0, 2, z22);
  put(1, 0, d1), put(1, 1, hn::Add(d1d2, e1e2));
  put(1, 2, hn::MulAdd(d1, z22, hn::Mul(two, hn::Mul(d2, e1e2))));
  put(2, 0, z11), put(2, 1, hn::MulAdd(d2, z11, hn::Mul(two, hn::Mul(d1, e1e2))));
  // E[z1^2 z2^2] = z11 z22 + 4 d1 d2 e1 e2 + 2 e1^2 e2^2
  put(2, 2, hn::MulAdd(z11, z22, hn::Mul(two, hn::MulAdd(two, hn::Mul(d1d2, e1e2), hn::Mul(e1e1, e2e2)))));
}

// Levenberg-Marquardt, each lane with its own damping.
void FitDouble(  // NOLINT(readability-function-size): see CONTRIBUTING.md
    std::span<const LineWindow> windows, std::span<DoubleFit> fits) {
  const D d;
  const size_t lanes = hn::Lanes(d);
  static thread_local const std::unique_ptr<Batch> kept = std::make_unique<Batch>();
  Batch& batch = *kept;
  HWY_ALIGN float best[6][kMaxLanes], trial[6][kMaxLanes], gradient[6][kMaxLanes], fresh[6][kMaxLanes];
  HWY_ALIGN float gram[21][kMaxLanes], step[6][kMaxLanes], chi_out[kMaxLanes], settled_out[kMaxLanes];
  for (size_t first = 0; first < windows.size(); first += lanes) {
    const size_t count = std::min(lanes, windows.size() - first);
    Gather(windows.subspan(first, count), batch);
    for (size_t lane = 0; lane < lanes; ++lane) {
      const DoubleFit& start = fits[first + std::min(lane, count - 1)];
      for (size_t m = 0; m < 2; ++m) {
        trial[3 * m][lane] = start.peaks[m].amplitude, trial[3 * m + 1][lane] = start.peaks[m].centre;
        trial[3 * m + 2][lane] = start.peaks[m].sigma;
      }
    }
    for (int i = 0; i < 6; ++i) hn::Store(hn::Load(d, trial[i]), d, best[i]);
    V chi2, trial_chi2, damping = Set(0.01f);
    DoubleSums(batch, best, gradient, chi2);
    auto settled = hn::Lt(chi2, hn::Zero(d));
    const V max_sigma = hn::Mul(hn::Load(d, batch.own_half), Set(3.0f));
    for (int iteration = 0; iteration < 25; ++iteration) {
      DoubleGram(best, gram);
      for (int i = 0; i < 6; ++i) {
        hn::Store(hn::Load(d, gradient[i]), d, step[i]);
        const V diagonal = hn::Load(d, gram[Packed(i, i)]);
        hn::Store(hn::MulAdd(diagonal, damping, diagonal), d, gram[Packed(i, i)]);
      }
      FactorLower(gram, 6);
      SolveLower(gram, 6, step);
      auto still = hn::Ge(chi2, hn::Zero(d));
      for (int m = 0; m < 2; ++m) {
        const V a = hn::Load(d, best[3 * m]), mu = hn::Load(d, best[3 * m + 1]),
                sigma = hn::Load(d, best[3 * m + 2]);
        const V da = hn::Load(d, step[3 * m]);
        const V safe_a = hn::CopySign(hn::Max(hn::Abs(a), Set(1e-6f)), a);
        const V per_a = hn::Div(sigma, safe_a);
        const V limit = hn::Mul(Set(0.5f), sigma), small = hn::Mul(Set(kSettled), sigma);
        const V dmu = hn::Max(hn::Min(hn::Mul(per_a, hn::Load(d, step[3 * m + 1])), limit), hn::Neg(limit));
        const V dsigma =
            hn::Max(hn::Min(hn::Mul(per_a, hn::Load(d, step[3 * m + 2])), limit), hn::Neg(limit));
        still = hn::And(still, hn::And(hn::Le(hn::Abs(dmu), small), hn::Le(hn::Abs(dsigma), small)));
        still = hn::And(still, hn::Le(hn::Abs(da), hn::Mul(Set(kSettled), hn::Abs(a))));
        hn::Store(hn::Add(a, da), d, trial[3 * m]);
        hn::Store(hn::Add(mu, dmu), d, trial[3 * m + 1]);
        hn::Store(hn::Max(hn::Min(hn::Add(sigma, dsigma), max_sigma), Set(0.5f)), d, trial[3 * m + 2]);
      }
      settled = hn::Or(settled, hn::And(still, hn::Lt(damping, Set(0.1f))));
      DoubleSums(batch, trial, fresh, trial_chi2);
      const auto better = hn::Le(trial_chi2, chi2);
      chi2 = hn::IfThenElse(better, trial_chi2, chi2);
      damping = hn::Max(hn::IfThenElse(better, hn::Mul(damping, Set(0.1f)), hn::Mul(damping, Set(10.0f))),
                        Set(1e-6f));
      for (int i = 0; i < 6; ++i) {
        hn::Store(hn::IfThenElse(better, hn::Load(d, trial[i]), hn::Load(d, best[i])), d, best[i]);
        hn::Store(hn::IfThenElse(better, hn::Load(d, fresh[i]), hn::Load(d, gradient[i])), d, gradient[i]);
      }
      if (hn::AllTrue(d, hn::Or(settled, hn::Gt(damping, Set(1e6f))))) break;
    }
    const V reach = hn::Load(d, batch.own_half);
    for (int m = 0; m < 2; ++m) {
      settled = hn::And(settled, hn::Gt(hn::Load(d, best[3 * m]), hn::Zero(d)));
      settled = hn::And(settled, hn::Le(hn::Abs(hn::Load(d, best[3 * m + 1])), reach));
    }
    hn::Store(chi2, d, chi_out);
    hn::Store(hn::IfThenElseZero(settled, Set(1.0f)), d, settled_out);
    for (size_t lane = 0; lane < count; ++lane) {
      DoubleFit& fit = fits[first + lane];
      fit.chi2 = chi_out[lane];
      fit.settled = settled_out[lane] > 0.0f;
      if (!fit.settled) continue;
      for (size_t m = 0; m < 2; ++m) {
        fit.peaks[m] = {best[3 * m][lane], best[3 * m + 1][lane], best[3 * m + 2][lane]};
      }
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(FitSingle);
HWY_EXPORT(FitDouble);

void fit_single(std::span<const LineWindow> windows, std::span<SingleFit> fits) {
  HWY_DYNAMIC_DISPATCH(FitSingle)(windows, fits);
}

void fit_double(std::span<const LineWindow> windows, std::span<DoubleFit> fits) {
  HWY_DYNAMIC_DISPATCH(FitDouble)(windows, fits);
}

}  // namespace glasswing
#endif
