#include "core/radiometry/dither.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace glasswing {
namespace {

constexpr std::int32_t kOne = (1 << 20) - 1;  // radiance 1
// The nearest code is looked up by coarse radiance; a suboptimal choice is diffused like any other error.
constexpr int kCoarse = 6;
constexpr size_t kEntries = size_t{1} << (20 - kCoarse);
constexpr int kCodeBits = 12;
constexpr std::uint32_t kCodeMask = (1u << kCodeBits) - 1;
constexpr size_t kBlock_px = 16;

void make_fixed(std::span<const float> radiances, std::int32_t* fixed) {
  constexpr auto kMax = static_cast<float>(kOne);
  for (const float radiance : radiances) {
    // Clamped last, in two steps, so that compilers vectorise it. NaN becomes 0.
    const float scaled = radiance * kMax + 0.5f;
    const float positive = scaled > 0.0f ? scaled : 0.0f;
    const float clamped = positive < kMax ? positive : kMax;
    *fixed++ = static_cast<std::int32_t>(clamped);
  }
}

// 0 or 1: such samples neither receive nor emit errors.
bool is_extreme(std::int32_t radiance) {
  return static_cast<std::uint32_t>(radiance - 1) >= static_cast<std::uint32_t>(kOne - 1);
}

}  // namespace

Dither::Dither(const std::array<ToneCurve, 3>& curves)
    : highest_(curves[0].highest_code()), nearest_(3 * kEntries) {
  for (size_t c = 0; c < 3; ++c) {
    assert(curves[c].highest_code() == highest_);
    for (size_t i = 0; i < kEntries; ++i) {
      // The last entry stands for radiance 1.
      const double radiance = i + 1 == kEntries ? 1.0 : static_cast<double>(i << kCoarse) / kOne;
      const double code = std::floor(curves[c].code_for(radiance) + 0.5);
      const auto shown = static_cast<std::uint32_t>(std::lround(curves[c].radiance(code) * kOne));
      nearest_[3 * i + c] = (shown << kCodeBits) | static_cast<std::uint32_t>(code);
    }
  }
}

// One row, pixel by pixel. `errors` holds the errors handed down by the row above; behind the current pixel
// it holds those for the row below. It has room for one pixel before the first and one after the last.
class Dither::Row {
 public:
  Row(const std::uint32_t* nearest, const std::int32_t* radiance, std::int32_t* errors, std::uint16_t* codes)
      : nearest_(nearest), radiance_(radiance), errors_(errors), codes_(codes) {}

  // True if all samples of these pixels are extreme.
  bool all_extreme(size_t from, size_t to) const {
    std::uint32_t between = 0;
    for (size_t i = 3 * from; i < 3 * to; ++i) between |= is_extreme(radiance_[i]) ? 0u : 1u;
    return between == 0;
  }
  void fill(size_t from, size_t to, int highest) {
    for (size_t i = 3 * from; i < 3 * to; ++i) codes_[i] = static_cast<std::uint16_t>(radiance_[i] & highest);
  }

  void step(size_t x) {
    for (size_t c = 0; c < 3; ++c) {
      const size_t i = 3 * x + c;
      const std::int32_t handed = is_extreme(radiance_[i]) ? 0 : left_[c] + errors_[i];
      const std::int32_t wanted = radiance_[i] + handed;
      const auto coarse = static_cast<size_t>(std::clamp(wanted, 0, kOne) >> kCoarse);
      const std::uint32_t entry = nearest_[3 * coarse + c];
      codes_[i] = static_cast<std::uint16_t>(entry & kCodeMask);
      const std::int32_t error = wanted - static_cast<std::int32_t>(entry >> kCodeBits);
      const std::int32_t below_before = (3 * error) >> 4, below = (5 * error) >> 4, below_after = error >> 4;
      left_[c] = error - below_before - below - below_after;
      errors_[static_cast<std::ptrdiff_t>(i) - 3] = before_[c] + below_before;
      before_[c] = here_[c] + below;
      here_[c] = below_after;
    }
  }
  // Call after the last pixel of a run that ends before `end`.
  void finish(size_t end) {
    for (size_t c = 0; c < 3; ++c) {
      errors_[static_cast<std::ptrdiff_t>(3 * end + c) - 3] = before_[c];
      errors_[3 * end + c] = here_[c];
    }
    left_ = before_ = here_ = {};
  }

 private:
  const std::uint32_t* nearest_;
  const std::int32_t* radiance_;
  std::int32_t* errors_;
  std::uint16_t* codes_;
  std::array<std::int32_t, 3> left_{};    // error for the next pixel
  std::array<std::int32_t, 3> before_{};  // for the pixel below the last one, so far
  std::array<std::int32_t, 3> here_{};    // for the pixel below the next one, so far
};

void Dither::run(std::span<Row> rows, size_t from, size_t to) {
  // Each pixel depends on the one before. Two interleaved rows, the lower two pixels behind, hide that
  // latency.
  if (rows.size() == 2 && to - from > 2) {
    rows[0].step(from);
    rows[0].step(from + 1);
    for (size_t x = from + 2; x < to; ++x) {
      rows[0].step(x);
      rows[1].step(x - 2);
    }
    rows[0].finish(to);
    rows[1].step(to - 2);
    rows[1].step(to - 1);
    rows[1].finish(to);
    return;
  }
  for (Row& row : rows) {
    for (size_t x = from; x < to; ++x) row.step(x);
    row.finish(to);
  }
}

void Dither::codes(const Rows& radiance, int width_px, std::span<std::uint16_t> codes) const {
  const auto width = static_cast<size_t>(width_px), samples = 3 * width;
  const size_t height = samples == 0 ? 0 : codes.size() / samples;
  std::vector<float> asked(samples);
  std::vector<std::int32_t> wanted(2 * samples), with_room(samples + 6, 0);
  std::int32_t* const errors = with_room.data() + 3;
  std::vector<Row> rows;
  for (size_t y = 0; y < height; y += rows.size()) {
    rows.clear();
    for (size_t i = 0; i < 2 && y + i < height; ++i) {
      radiance(static_cast<int>(y + i), asked);
      make_fixed(asked, wanted.data() + i * samples);
      rows.emplace_back(nearest_.data(), wanted.data() + i * samples, errors,
                        codes.data() + (y + i) * samples);
    }
    const auto is_plain = [&](size_t block) {
      const size_t from = block * kBlock_px, to = std::min(from + kBlock_px, width);
      return std::all_of(rows.begin(), rows.end(), [&](const Row& row) { return row.all_extreme(from, to); });
    };
    // Blocks whose samples are all extreme need no diffusion.
    const size_t blocks = (width + kBlock_px - 1) / kBlock_px;
    for (size_t first = 0, end = 0; first < blocks; first = end) {
      const bool plain = is_plain(first);
      for (end = first + 1; end < blocks && is_plain(end) == plain;) ++end;
      const size_t from = first * kBlock_px, to = std::min(end * kBlock_px, width);
      if (plain) {
        for (Row& row : rows) row.fill(from, to, highest_);
        // Except what the pixel before this run handed to the one below.
        const size_t clean = from == 0 ? 0 : from + 1;
        std::fill(errors + 3 * clean, errors + 3 * to, 0);
      } else {
        run(rows, from, to);
      }
    }
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
