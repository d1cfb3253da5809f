#include "core/radiometry/dither.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr std::int32_t kOne = (1 << 20) - 1;  // radiance 1
// Which code is nearest is looked up for radiances this coarse; an ill choice is handed on as any error is.
constexpr int kCoarse = 6;
constexpr size_t kEntries = size_t{1} << (20 - kCoarse);
constexpr int kCodeBits = 12;
constexpr std::uint32_t kCodeMask = (1u << kCodeBits) - 1;

std::int32_t fixed_of(float radiance) {
  const float positive = radiance > 0.0f ? radiance : 0.0f;  // NaN is 0
  const float clamped = positive < 1.0f ? positive : 1.0f;
  return static_cast<std::int32_t>(clamped * static_cast<float>(kOne) + 0.5f);
}

}  // namespace

Dither::Dither(const std::array<ToneCurve, 3>& curves) : nearest_(3 * kEntries) {
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < kEntries; ++i) {
      const double radiance = static_cast<double>(i << kCoarse) / kOne;
      const double code = std::floor(curves[c].code_for(radiance) + 0.5);
      const auto shown = static_cast<std::uint32_t>(std::lround(curves[c].radiance(code) * kOne));
      nearest_[3 * i + c] = (shown << kCodeBits) | static_cast<std::uint32_t>(code);
    }
  }
}

// errors: what the row above hands down to each sample; then what this one does.
void Dither::row(const float* radiance, size_t width, std::int32_t* errors, std::uint16_t* codes) const {
  std::array<std::int32_t, 3> left{};    // handed on to this pixel by the one before
  std::array<std::int32_t, 3> before{};  // to the one below the one before, so far
  std::array<std::int32_t, 3> here{};    // to the one below, so far
  for (size_t x = 0; x < width; ++x) {
    for (size_t c = 0; c < 3; ++c) {
      const size_t i = 3 * x + c;
      const std::int32_t wanted = fixed_of(radiance[i]) + left[c] + errors[i];
      const auto coarse = static_cast<size_t>(std::clamp(wanted, 0, kOne) >> kCoarse);
      const std::uint32_t entry = nearest_[3 * coarse + c];
      codes[i] = static_cast<std::uint16_t>(entry & kCodeMask);
      const std::int32_t error = wanted - static_cast<std::int32_t>(entry >> kCodeBits);
      const std::int32_t below_before = 3 * error / 16, below = 5 * error / 16, below_after = error / 16;
      left[c] = error - below_before - below - below_after;
      if (x > 0) errors[i - 3] = before[c] + below_before;
      before[c] = here[c] + below;
      here[c] = below_after;
    }
  }
  for (size_t c = 0; c < 3; ++c) errors[3 * (width - 1) + c] = before[c];
}

Image<std::uint16_t> Dither::codes(const RadianceImage& radiance) const {
  Image<std::uint16_t> codes(radiance.width_px, radiance.height_px);
  const auto width = static_cast<size_t>(radiance.width_px);
  std::vector<std::int32_t> errors(3 * width, 0);
  for (size_t at = 0; at < codes.samples.size(); at += 3 * width)
    row(radiance.samples.data() + at, width, errors.data(), codes.samples.data() + at);
  return codes;
}

}  // namespace glasswing
