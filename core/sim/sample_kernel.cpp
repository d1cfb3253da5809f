#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/sim/sample_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <array>

#include "core/sim/sample_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using F = hn::ScalableTag<float>;
using U = hn::RebindToUnsigned<F>;
constexpr std::uint32_t kQuarter = kSampleBlock / 4;

struct Words {
  hn::Vec<U> a, b, c, d;
};

template <int kLeft>
void Mix(hn::Vec<U>& x, hn::Vec<U>& y) {
  x = hn::Add(x, y);
  y = hn::Xor(hn::RotateRight<32 - kLeft>(y), x);
}

Words Threefry(Words x, const std::array<std::uint32_t, 4>& key) {
  const U d;
  const std::array<std::uint32_t, 5> keys{key[0], key[1], key[2], key[3],
                                          key[0] ^ key[1] ^ key[2] ^ key[3] ^ 0x1BD11BDAu};
  for (std::uint32_t i = 0; i <= 5; ++i) {  // four rounds between two additions of the key
    x.a = hn::Add(x.a, hn::Set(d, keys[i % 5]));
    x.b = hn::Add(x.b, hn::Set(d, keys[(i + 1) % 5]));
    x.c = hn::Add(x.c, hn::Set(d, keys[(i + 2) % 5]));
    x.d = hn::Add(x.d, hn::Set(d, keys[(i + 3) % 5] + i));
    if (i == 5) break;
    if (i % 2 == 0) {
      Mix<10>(x.a, x.b), Mix<26>(x.c, x.d), Mix<11>(x.a, x.d), Mix<21>(x.c, x.b);
      Mix<13>(x.a, x.b), Mix<27>(x.c, x.d), Mix<23>(x.a, x.d), Mix<5>(x.c, x.b);
    } else {
      Mix<6>(x.a, x.b), Mix<20>(x.c, x.d), Mix<17>(x.a, x.d), Mix<11>(x.c, x.b);
      Mix<25>(x.a, x.b), Mix<10>(x.c, x.d), Mix<18>(x.a, x.d), Mix<20>(x.c, x.b);
    }
  }
  return x;
}

// Box-Muller: two deviates from two words.
void Normals(hn::Vec<U> u, hn::Vec<U> v, float* first, float* second) {
  const F d;
  const U du;
  const hn::RebindToSigned<F> di;
  // ln of a uniform number in (0, 1]; halves keep the conversion signed.
  const auto half = hn::ConvertTo(d, hn::BitCast(di, hn::ShiftRight<1>(u)));
  const auto uniform = hn::MulAdd(half, hn::Set(d, 0x1p-31f), hn::Set(d, 0x1p-33f));
  const auto radius = hn::Sqrt(hn::Max(hn::Mul(hn::Set(d, -2.0f), hn::Log(d, uniform)), hn::Zero(d)));
  // An angle within an eighth turn of +x, then mirrored at x = y and at the origin by two random bits.
  const auto angle =
      hn::Mul(hn::ConvertTo(d, hn::BitCast(di, hn::ShiftLeft<2>(v))), hn::Set(d, 0x1.921fb6p-32f));
  const auto square = hn::Mul(angle, angle);
  const auto sine = hn::Mul(
      angle, hn::MulAdd(square,
                        hn::MulAdd(square,
                                   hn::MulAdd(square, hn::Set(d, -1.0f / 5040.0f), hn::Set(d, 1.0f / 120.0f)),
                                   hn::Set(d, -1.0f / 6.0f)),
                        hn::Set(d, 1.0f)));
  const auto cosine = hn::MulAdd(
      square,
      hn::MulAdd(
          square,
          hn::MulAdd(square, hn::MulAdd(square, hn::Set(d, 1.0f / 40320.0f), hn::Set(d, -1.0f / 720.0f)),
                     hn::Set(d, 1.0f / 24.0f)),
          hn::Set(d, -0.5f)),
      hn::Set(d, 1.0f));
  const auto sign = hn::BitCast(d, hn::And(v, hn::Set(du, 0x80000000u)));
  const auto swapped = hn::RebindMask(d, hn::Ne(hn::And(v, hn::Set(du, 0x40000000u)), hn::Zero(du)));
  hn::StoreU(hn::Xor(hn::Mul(radius, hn::IfThenElse(swapped, sine, cosine)), sign), d, first);
  hn::StoreU(hn::Xor(hn::Mul(radius, hn::IfThenElse(swapped, cosine, sine)), sign), d, second);
}

void StandardNormals(std::uint64_t seed, std::int64_t stream, std::uint32_t block, float* out) {
  const U d;
  const auto number = static_cast<std::uint64_t>(stream);
  const std::array<std::uint32_t, 4> key{
      static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
      static_cast<std::uint32_t>(number), static_cast<std::uint32_t>(number >> 32)};
  for (std::uint32_t i = 0; i < kQuarter; i += static_cast<std::uint32_t>(hn::Lanes(d))) {
    const Words words = Threefry({hn::Iota(d, i), hn::Set(d, block), hn::Zero(d), hn::Zero(d)}, key);
    Normals(words.a, words.b, out + i, out + i + kQuarter);
    Normals(words.c, words.d, out + i + 2 * kQuarter, out + i + 3 * kQuarter);
  }
}

hn::Vec<F> Coded(const SensorCurve& curve, hn::Vec<F> linear) {
  const F d;
  // Avoids the logarithm of 0; light this faint is below any code.
  const auto above_zero = hn::Max(linear, hn::Set(d, 1e-30f));
  const auto u = hn::Exp(d, hn::Mul(hn::Set(d, curve.exponent), hn::Log(d, above_zero)));
  const auto steep = hn::Mul(hn::Mul(u, u), hn::NegMulAdd(hn::Set(d, 2.0f), u, hn::Set(d, 3.0f)));
  return hn::Min(hn::MulAdd(hn::Set(d, curve.contrast), hn::Sub(steep, u), u), hn::Set(d, 1.0f));
}

void Respond(const SampleResponse& response, const float* radiance, const float* deviates,
             std::uint16_t* out) {
  const F d;
  const hn::RebindToSigned<F> di;
  const hn::Rebind<std::uint16_t, F> narrow;
  const auto levels = hn::Set(d, static_cast<float>(response.levels));
  const auto int_levels = hn::Set(di, response.levels);
  const auto to_16_bits = hn::Set(d, 65535.0f / static_cast<float>(response.levels));
  const bool curved = response.curve != SensorCurve();
  for (size_t i = 0; i < kSampleBlock; i += hn::Lanes(d)) {
    const auto value = hn::Mul(hn::LoadU(d, radiance + i), hn::Set(d, response.scale));
    const auto variance = hn::MulAdd(hn::Set(d, response.gain), hn::Max(value, hn::Zero(d)),
                                     hn::Set(d, response.read_variance));
    const auto noisy = hn::MulAdd(hn::Sqrt(variance), hn::LoadU(d, deviates + i), value);
    const auto black = hn::Set(d, response.black);
    const auto raised = hn::MulAdd(hn::Set(d, 1.0f - response.black), noisy, black);
    const auto clamped = hn::Min(hn::Max(raised, hn::Zero(d)), hn::Set(d, 1.0f));
    const auto sample = curved ? Coded(response.curve, clamped) : clamped;
    const auto code = hn::ConvertTo(di, hn::MulAdd(sample, levels, hn::Set(d, 0.5f)));
    // code * 65535 / levels, rounded; a float may miss by one. There are no ties: levels is odd.
    auto stored = hn::ConvertTo(di, hn::MulAdd(hn::ConvertTo(d, code), to_16_bits, hn::Set(d, 0.5f)));
    const auto excess = hn::Sub(hn::Mul(code, hn::Set(di, 65535)), hn::Mul(stored, int_levels));
    const auto twice = hn::Add(excess, excess);
    stored = hn::Sub(stored, hn::VecFromMask(di, hn::Gt(twice, int_levels)));
    stored = hn::Add(stored, hn::VecFromMask(di, hn::Lt(twice, hn::Neg(int_levels))));
    hn::StoreU(hn::DemoteTo(narrow, stored), narrow, out + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(StandardNormals);
HWY_EXPORT(Respond);

void standard_normals(std::uint64_t seed, std::int64_t stream, std::uint32_t block,
                      std::span<float, kSampleBlock> out) {
  HWY_DYNAMIC_DISPATCH(StandardNormals)(seed, stream, block, out.data());
}

void respond(const SampleResponse& response, std::span<const float, kSampleBlock> radiance,
             std::span<const float, kSampleBlock> deviates, std::span<std::uint16_t, kSampleBlock> out) {
  HWY_DYNAMIC_DISPATCH(Respond)(response, radiance.data(), deviates.data(), out.data());
}

}  // namespace glasswing
#endif
