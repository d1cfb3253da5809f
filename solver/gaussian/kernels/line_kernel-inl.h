// Gaussians along equally spaced samples, for kernels that sum over them. Included once per target.
#if defined(GLASSWING_LINE_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GLASSWING_LINE_KERNEL_INL_H_
#undef GLASSWING_LINE_KERNEL_INL_H_
#else
#define GLASSWING_LINE_KERNEL_INL_H_
#endif

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <numbers>

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
constexpr int kMaxLanes = 16;
using D = hn::CappedTag<float, kMaxLanes>;
using V = hn::Vec<D>;

HWY_INLINE V Set(float v) {
  return hn::Set(D(), v);
}

// One Gaussian along k, by recurrence.
struct Run {
  V g, q;
};

struct Shape {
  V inverse_variance, ratio;  // ratio = exp(-1 / sigma^2)
  Run up, down;               // at k = 0, and q towards k = 1 and k = -1
};

HWY_INLINE Shape Begin(V mu, V sigma) {
  const D d;
  Shape shape;
  shape.inverse_variance = hn::Div(Set(1.0f), hn::Mul(sigma, sigma));
  const V half = hn::Mul(Set(0.5f), shape.inverse_variance);
  shape.ratio = hn::Exp(d, hn::Neg(shape.inverse_variance));
  shape.up.g = shape.down.g = hn::Exp(d, hn::Neg(hn::Mul(half, hn::Mul(mu, mu))));
  // g(1) / g(0) = exp((2 mu - 1) / (2 sigma^2))
  const V twice = hn::Add(mu, mu);
  shape.up.q = hn::Exp(d, hn::Mul(half, hn::Sub(twice, Set(1.0f))));
  shape.down.q = hn::Exp(d, hn::Mul(half, hn::Sub(hn::Neg(twice), Set(1.0f))));
  return shape;
}

HWY_INLINE void Step(Run& run, V ratio) {
  run.g = hn::Mul(run.g, run.q);
  run.q = hn::Mul(run.q, ratio);
}

// sum r g, sum r g z, sum r g z^2 of one Gaussian.
struct Moments {
  V m0, m1, m2;
  void Add(V h, V k) {
    m0 = hn::Add(m0, h);
    const V hk = hn::Mul(h, k);
    m1 = hn::Add(m1, hk);
    m2 = hn::MulAdd(hk, k, m2);
  }
  void ToUnits(V mu, V sigma) {
    const V inverse = hn::Div(Set(1.0f), sigma);
    const V first = hn::NegMulAdd(mu, m0, m1);
    m2 = hn::Mul(hn::Mul(hn::NegMulAdd(mu, hn::Add(m1, first), m2), inverse), inverse);
    m1 = hn::Mul(first, inverse);
  }
};

constexpr float kInverseRootPi = 0.56418958f;

using Row = float[kMaxLanes];

// A symmetric matrix's lower triangle, packed by rows.
HWY_INLINE int Packed(int i, int j) {
  return i * (i + 1) / 2 + j;
}

// Replaces it by its Cholesky factor L, with the inverses of L's diagonal. A matrix that is not positive is
// treated as if its diagonal were slightly larger.
HWY_INLINE void FactorLower(Row* matrix, int n) {
  const D d;
  for (int j = 0; j < n; ++j) {
    const float* row = matrix[Packed(j, 0)];
    V diagonal = hn::Load(d, matrix[Packed(j, j)]);
    const V least = hn::MulAdd(diagonal, Set(3e-6f), Set(1e-30f));
    for (int k = 0; k < j; ++k) {
      const V own = hn::Load(d, row + k * kMaxLanes);
      diagonal = hn::NegMulAdd(own, own, diagonal);
    }
    const V inverse = hn::Div(Set(1.0f), hn::Sqrt(hn::Max(diagonal, least)));
    hn::Store(inverse, d, matrix[Packed(j, j)]);
    for (int i = j + 1; i < n; ++i) {
      const float* other = matrix[Packed(i, 0)];
      V sum = hn::Load(d, matrix[Packed(i, j)]);
      for (int k = 0; k < j; ++k)
        sum = hn::NegMulAdd(hn::Load(d, other + k * kMaxLanes), hn::Load(d, row + k * kMaxLanes), sum);
      hn::Store(hn::Mul(sum, inverse), d, matrix[Packed(i, j)]);
    }
  }
}

// Solves L L' x = x.
HWY_INLINE void SolveLower(const Row* factor, int n, Row* x) {
  const D d;
  for (int i = 0; i < n; ++i) {
    V sum = hn::Load(d, x[i]);
    for (int k = 0; k < i; ++k)
      sum = hn::NegMulAdd(hn::Load(d, factor[Packed(i, k)]), hn::Load(d, x[k]), sum);
    hn::Store(hn::Mul(sum, hn::Load(d, factor[Packed(i, i)])), d, x[i]);
  }
  for (int i = n - 1; i >= 0; --i) {
    V sum = hn::Load(d, x[i]);
    for (int k = i + 1; k < n; ++k)
      sum = hn::NegMulAdd(hn::Load(d, factor[Packed(k, i)]), hn::Load(d, x[k]), sum);
    hn::Store(hn::Mul(sum, hn::Load(d, factor[Packed(i, i)])), d, x[i]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#endif
