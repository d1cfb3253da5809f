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

// One row, pixel by pixel. `errors` is what the row above hands down to each sample, and behind the pixel
// what this one does.
class Dither::Row {
 public:
  Row(const std::uint32_t* nearest, const float* radiance, std::int32_t* errors, std::uint16_t* codes)
      : nearest_(nearest), radiance_(radiance), errors_(errors), codes_(codes) {}

  void step(size_t x) {
    for (size_t c = 0; c < 3; ++c) {
      const size_t i = 3 * x + c;
      const std::int32_t wanted = fixed_of(radiance_[i]) + left_[c] + errors_[i];
      const auto coarse = static_cast<size_t>(std::clamp(wanted, 0, kOne) >> kCoarse);
      const std::uint32_t entry = nearest_[3 * coarse + c];
      codes_[i] = static_cast<std::uint16_t>(entry & kCodeMask);
      const std::int32_t error = wanted - static_cast<std::int32_t>(entry >> kCodeBits);
      const std::int32_t below_before = (3 * error) >> 4, below = (5 * error) >> 4, below_after = error >> 4;
      left_[c] = error - below_before - below - below_after;
      if (x > 0) errors_[i - 3] = before_[c] + below_before;
      before_[c] = here_[c] + below;
      here_[c] = below_after;
    }
  }
  // After the last pixel.
  void finish(size_t width) {
    for (size_t c = 0; c < 3; ++c) errors_[3 * (width - 1) + c] = before_[c];
  }

 private:
  const std::uint32_t* nearest_;
  const float* radiance_;
  std::int32_t* errors_;
  std::uint16_t* codes_;
  std::array<std::int32_t, 3> left_{};    // handed on to the next pixel
  std::array<std::int32_t, 3> before_{};  // to the one below the last, so far
  std::array<std::int32_t, 3> here_{};    // to the one below the next, so far
};

Image<std::uint16_t> Dither::codes(const RadianceImage& radiance) const {
  Image<std::uint16_t> codes(radiance.width_px, radiance.height_px);
  const auto width = static_cast<size_t>(radiance.width_px);
  std::vector<std::int32_t> errors(3 * width, 0);
  const auto row = [&](size_t at) {
    return Row(nearest_.data(), radiance.samples.data() + at, errors.data(), codes.samples.data() + at);
  };
  // A pixel waits for the one before. Two rows at once, the lower two pixels behind, keep a processor busy.
  size_t at = 0;
  for (; width > 2 && at + 3 * width < codes.samples.size(); at += 6 * width) {
    Row upper = row(at), lower = row(at + 3 * width);
    upper.step(0);
    upper.step(1);
    for (size_t x = 2; x < width; ++x) {
      upper.step(x);
      lower.step(x - 2);
    }
    upper.finish(width);
    lower.step(width - 2);
    lower.step(width - 1);
    lower.finish(width);
  }
  for (; at < codes.samples.size(); at += 3 * width) {
    Row last = row(at);
    for (size_t x = 0; x < width; ++x) last.step(x);
    last.finish(width);
  }
  return codes;
}

}  // namespace glasswing
