#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/radiometry/dither_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include <algorithm>

#include "core/radiometry/dither_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<std::int32_t, kMaxDitherRows>;
using V = hn::Vec<D>;
constexpr size_t kChannels = 3;
constexpr size_t kStretch_px = 32;  // skewed at a time, so that it stays in the first cache

size_t Rows() {
  return hn::Lanes(D());
}

void ToFixed(const float* radiances, size_t count, std::int32_t* fixed) {
  const hn::ScalableTag<std::int32_t> d;
  const hn::RebindToFloat<decltype(d)> df;
  const auto full = hn::Set(df, static_cast<float>(kFullRadiance)), zero = hn::Zero(df);
  const auto converted = [&](auto radiance) {
    const auto scaled = hn::MulAdd(radiance, full, hn::Set(df, 0.5f));
    return hn::ConvertTo(d, hn::Min(hn::IfThenElseZero(hn::Gt(scaled, zero), scaled), full));
  };
  const size_t lanes = hn::Lanes(d);
  size_t i = 0;
  for (; i + lanes <= count; i += lanes) hn::StoreU(converted(hn::LoadU(df, radiances + i)), d, fixed + i);
  for (; i < count; ++i) fixed[i] = hn::GetLane(converted(hn::Set(df, radiances[i])));
}

// The errors of one channel on their way.
struct Errors {
  V left;          // to the next pixel
  V below;         // to the pixel below the last one: complete
  V before, here;  // to the pixels below this one and the next: so far
};

// One sample of each row; returns the codes. `above`: what the row above the first hands down. `errors.below`
// is left for the pixel below the one before.
HWY_INLINE V Step(V radiance, V above, const std::int32_t* nearest, V highest, Errors& errors) {
  const D d;
  const hn::RebindToUnsigned<D> du;
  const V full = hn::Set(d, kFullRadiance), zero = hn::Zero(d);
  const auto extreme = hn::Or(hn::Eq(radiance, zero), hn::Eq(radiance, full));
  const V wanted = hn::Add(radiance, hn::IfThenZeroElse(extreme, hn::Add(errors.left, above)));
  const V coarse = hn::ShiftRight<kCoarseBits>(hn::Min(hn::Max(wanted, zero), full));
  const V entry = hn::GatherIndex(d, nearest, coarse);
  const V code = hn::And(entry, hn::Set(d, (1 << kDitherCodeBits) - 1));
  const V shown = hn::BitCast(d, hn::ShiftRight<kDitherCodeBits>(hn::BitCast(du, entry)));
  const V error = hn::IfThenZeroElse(extreme, hn::Sub(wanted, shown));
  const V twice = hn::Add(error, error);
  const V below_before = hn::ShiftRight<4>(hn::Add(twice, error));
  const V below = hn::ShiftRight<4>(hn::Add(hn::Add(twice, twice), error));
  const V below_after = hn::ShiftRight<4>(error);
  errors.left = hn::Sub(hn::Sub(error, below_before), hn::Add(below, below_after));
  errors.below = hn::Add(errors.before, below_before);
  errors.before = hn::Add(errors.here, below);
  errors.here = below_after;
  return hn::IfThenElse(extreme, hn::And(radiance, highest), code);
}

// The pixels [first, first + count) of the wave: row r is at pixel first - 2 r. What is outside begin_px to
// end_px is radiance 0.
void Skew(const DitherRows& rows, size_t first, size_t count, std::int32_t* skewed) {
  const size_t lanes = Rows();
  for (size_t r = 0; r < lanes; ++r) {
    const size_t delay = 2 * r, end = count * kChannels;
    const bool is_row = r < rows.count;
    // Samples of this stretch that are within the row's pixels.
    const auto at = [&](size_t px) { return std::clamp(px + delay, first, first + count) - first; };
    const size_t from = is_row ? kChannels * at(rows.begin_px) : end;
    const size_t to = is_row ? kChannels * at(rows.end_px) : end;
    for (size_t i = 0; i < from; ++i) skewed[i * lanes + r] = 0;
    const std::int32_t* const row = rows.radiance + r * kChannels * rows.width_px;
    const size_t behind = kChannels * delay, ahead = kChannels * first;
    for (size_t i = from; i < to; ++i) skewed[i * lanes + r] = row[ahead + i - behind];
    for (size_t i = to; i < end; ++i) skewed[i * lanes + r] = 0;
  }
}

void Unskew(const DitherRows& rows, size_t first, size_t count, const std::int32_t* skewed) {
  const size_t lanes = Rows();
  for (size_t r = 0; r < rows.count; ++r) {
    const size_t delay = 2 * r;
    const auto at = [&](size_t px) { return std::clamp(px + delay, first, first + count) - first; };
    const size_t from = kChannels * at(rows.begin_px), to = kChannels * at(rows.end_px);
    std::uint16_t* const row = rows.codes + r * kChannels * rows.width_px;
    const size_t behind = kChannels * delay, ahead = kChannels * first;
    for (size_t i = from; i < to; ++i)
      row[ahead + i - behind] = static_cast<std::uint16_t>(skewed[i * lanes + r]);
  }
}

void Diffuse(const DitherRows& rows) {
  const D d;
  const size_t lanes = Rows(), delay = 2 * (lanes - 1);
  // [sample of the wave][row]
  HWY_ALIGN std::int32_t skewed[kStretch_px * kChannels * kMaxDitherRows];
  HWY_ALIGN std::int32_t from_above[kMaxDitherRows];
  for (size_t r = 0; r < lanes; ++r) from_above[r] = static_cast<std::int32_t>(r == 0 ? lanes - 1 : r - 1);
  const auto rotate = hn::SetTableIndices(d, from_above);
  const auto first_row = hn::FirstN(d, 1);
  const V highest = hn::Set(d, static_cast<std::int32_t>(rows.highest));
  Errors errors[kChannels];
  for (Errors& each : errors) each = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  // The last row hands errors down to the pixel after its last one, and they are stored a step later.
  const size_t end = rows.end_px + delay + 3;
  for (size_t first = rows.begin_px; first < end; first += kStretch_px) {
    const size_t count = std::min(kStretch_px, end - first);
    Skew(rows, first, count, skewed);
    for (size_t k = 0; k < count; ++k) {
      const size_t at = first + k;  // the pixel of the first row
      for (size_t c = 0; c < kChannels; ++c) {
        Errors& of = errors[c];
        std::int32_t* const handed = rows.errors + kChannels * at + c;
        const V rotated = hn::TableLookupLanes(of.below, rotate);
        // What the last row left at the step before, for the pixel below the one before its own.
        if (at >= rows.begin_px + delay + 1)
          rows.errors[static_cast<std::ptrdiff_t>(kChannels * (at - delay - 1) + c) - 3] =
              hn::GetLane(rotated);
        const V above = hn::IfThenElse(first_row, hn::Set(d, *handed), rotated);
        std::int32_t* const samples = skewed + (kChannels * k + c) * lanes;
        const auto* const nearest = reinterpret_cast<const std::int32_t*>(rows.nearest + c * kDitherEntries);
        hn::Store(Step(hn::Load(d, samples), above, nearest, highest, of), d, samples);
      }
    }
    Unskew(rows, first, count, skewed);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(Rows);
HWY_EXPORT(ToFixed);
HWY_EXPORT(Diffuse);

size_t dither_rows() {
  return HWY_DYNAMIC_DISPATCH(Rows)();
}

void to_fixed(std::span<const float> radiances, std::int32_t* fixed) {
  HWY_DYNAMIC_DISPATCH(ToFixed)(radiances.data(), radiances.size(), fixed);
}

void diffuse(const DitherRows& rows) {
  HWY_DYNAMIC_DISPATCH(Diffuse)(rows);
}

}  // namespace glasswing
#endif
