#include "core/radiometry/dither.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "core/radiometry/dither_kernel.h"

namespace glasswing {
namespace {

constexpr size_t kBlock = 48;  // samples

// True if all are 0 or 1: such samples neither receive nor emit errors.
bool all_extreme(std::span<const std::int32_t> radiances) {
  std::uint32_t between = 0;
  for (const std::int32_t radiance : radiances)
    between |= static_cast<std::uint32_t>(radiance - 1) < static_cast<std::uint32_t>(kFullRadiance - 1);
  return between == 0;
}

// The samples of a row before the first block that is not all extreme, and to the end of the last one.
std::pair<size_t, size_t> range_between(std::span<const std::int32_t> row) {
  size_t from = 0, to = row.size();
  while (from < to && all_extreme(row.subspan(from, std::min(kBlock, to - from))))
    from += std::min(kBlock, to - from);
  while (to > from && all_extreme(row.subspan(to - std::min(kBlock, to - from), std::min(kBlock, to - from))))
    to -= std::min(kBlock, to - from);
  return {from, to};
}

}  // namespace

Dither::Dither(const std::array<ToneCurve, 3>& curves)
    : highest_(curves[0].highest_code()), nearest_(3 * kDitherEntries) {
  for (size_t c = 0; c < 3; ++c) {
    assert(curves[c].highest_code() == highest_);
    for (size_t i = 0; i < kDitherEntries; ++i) {
      // The last entry stands for radiance 1.
      const double radiance =
          i + 1 == kDitherEntries ? 1.0 : static_cast<double>(i << kCoarseBits) / kFullRadiance;
      const double code = std::floor(curves[c].code_for(radiance) + 0.5);
      const auto shown = static_cast<std::uint32_t>(std::lround(curves[c].radiance(code) * kFullRadiance));
      nearest_[c * kDitherEntries + i] = (shown << kDitherCodeBits) | static_cast<std::uint32_t>(code);
    }
  }
}

void Dither::codes(const Rows& radiance, int width_px, std::span<std::uint16_t> codes) const {
  const auto width = static_cast<size_t>(width_px), samples = 3 * width;
  const size_t height = samples == 0 ? 0 : codes.size() / samples;
  std::vector<float> asked(samples);
  std::vector<std::int32_t> fixed(dither_rows() * samples), with_room(samples + 6 * kErrorRoom_px, 0);
  std::int32_t* const errors = with_room.data() + 3 * kErrorRoom_px;
  for (size_t y = 0; y < height; y += dither_rows()) {
    const size_t count = std::min(dither_rows(), height - y);
    size_t from = samples, to = 0;
    for (size_t r = 0; r < count; ++r) {
      const std::span<std::int32_t> row(fixed.data() + r * samples, samples);
      radiance(static_cast<int>(y + r), asked);
      to_fixed(asked, row.data());
      const auto [first, last] = range_between(row);
      if (first < last) from = std::min(from, first), to = std::max(to, last);
    }
    from = std::min(from, to);
    for (size_t r = 0; r < count; ++r) {
      const std::int32_t* const row = fixed.data() + r * samples;
      std::uint16_t* const shown = codes.data() + (y + r) * samples;
      for (size_t i = 0; i < from; ++i) shown[i] = static_cast<std::uint16_t>(row[i] & highest_);
      for (size_t i = to; i < samples; ++i) shown[i] = static_cast<std::uint16_t>(row[i] & highest_);
    }
    if (from == to) {
      std::ranges::fill(with_room, 0);
      continue;
    }
    const size_t begin_px = from / 3, end_px = to / 3;
    diffuse({.nearest = nearest_.data(),
             .highest = static_cast<std::uint32_t>(highest_),
             .radiance = fixed.data(),
             .count = count,
             .width_px = width,
             .begin_px = begin_px,
             .end_px = end_px,
             .errors = errors,
             .codes = codes.data() + y * samples});
    // Nothing else was handed down.
    std::fill(with_room.data(), errors + 3 * (begin_px == 0 ? 0 : begin_px - 1), 0);
    std::fill(errors + 3 * std::min(end_px + 1, width), with_room.data() + with_room.size(), 0);
  }
}

Image<std::uint16_t> Dither::codes(const RadianceImage& radiance) const {
  Image<std::uint16_t> shown(radiance.width_px, radiance.height_px);
  const auto samples = 3 * static_cast<std::ptrdiff_t>(radiance.width_px);
  const auto copy = [&](int y_px, std::span<float> row) {
    std::copy_n(radiance.samples.begin() + y_px * samples, samples, row.begin());
  };
  codes(copy, radiance.width_px, shown.samples);
  return shown;
}

}  // namespace glasswing
