#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/composite/tile_kernel.cpp"
#include <hwy/foreach_target.h>
//
#include <half.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>

#include "core/composite/tile_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace glasswing {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using F = hn::ScalableTag<float>;
using T = hn::CappedTag<float, kTileWidth>;
using H = hn::Rebind<hwy::float16_t, T>;

struct Tile {
  size_t offset, stride, rows;
  const hwy::float16_t* across;
};

// Reads a tile; stores its row weights to `down` if it has several rows.
HWY_INLINE Tile NextTile(const std::uint16_t*& words, float* down) {
  const T d;
  const H half;
  const Tile tile{.offset = words[0] | static_cast<size_t>(words[1]) << 16,
                  .stride = words[2],
                  .rows = words[3],
                  .across = reinterpret_cast<const hwy::float16_t*>(words + kTileHeader)};
  words += kTileHeader + kTileWidth;
  if (tile.rows == 1) return tile;
  // The last vector may read beyond the tile.
  const auto* weights = reinterpret_cast<const hwy::float16_t*>(words);
  for (size_t r = 0; r < tile.rows; r += hn::Lanes(d))
    hn::StoreU(hn::PromoteTo(d, hn::LoadU(half, weights + r)), d, down + r);
  words += tile.rows;
  return tile;
}

HWY_INLINE hn::Vec<T> Sum(const Tile& tile, const float* down, const float* samples, hn::Vec<T> sum) {
  const T d;
  const H half;
  const size_t row = 3 * tile.stride;
  for (size_t part = 0; part < kTileWidth; part += hn::Lanes(d)) {
    const float* from = samples + part;
    auto column = hn::LoadU(d, from);
    if (tile.rows > 1) {
      column = hn::Mul(column, hn::Set(d, down[0]));
      for (size_t r = 1; r < tile.rows; ++r) {
        from += row;
        column = hn::MulAdd(hn::Set(d, down[r]), hn::LoadU(d, from), column);
      }
    }
    sum = hn::MulAdd(hn::PromoteTo(d, hn::LoadU(half, tile.across + part)), column, sum);
  }
  return sum;
}

// Points, which stand where a tile's header says 0 rows.
HWY_INLINE hn::Vec<T> SumPoints(const std::uint16_t*& words, const float* samples, hn::Vec<T> sum) {
  const T d;
  const H half;
  const hn::RebindToSigned<T> whole;
  const hn::Rebind<std::uint16_t, T> narrow;
  const float* const from = samples + (words[0] | static_cast<size_t>(words[1]) << 16);
  const size_t count = (words[2] + size_t{kTileWidth - 1}) / kTileWidth * kTileWidth;
  const std::uint16_t* const distances = words + kTileHeader;
  const auto* const weights = reinterpret_cast<const hwy::float16_t*>(distances + count);
  words = distances + 2 * count;
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto light = hn::GatherIndex(d, from, hn::PromoteTo(whole, hn::LoadU(narrow, distances + i)));
    sum = hn::MulAdd(hn::PromoteTo(d, hn::LoadU(half, weights + i)), light, sum);
  }
  return sum;
}

void EvaluateTiles(const PixelTiles* pixels, size_t count, const std::uint16_t* words, const float* samples,
                   float* light) {
  const T d;
  HWY_ALIGN float down[kMaxTileRows + kTileWidth];
  for (size_t p = 0; p < count; ++p, light += 3) {
    const PixelTiles& pixel = pixels[p];
    auto r = hn::Zero(d), g = hn::Zero(d), b = hn::Zero(d);
    for (int i = 0; i < pixel.shared; ++i) {
      const Tile tile = NextTile(words, down);
      const float* from = samples + tile.offset;
      r = Sum(tile, down, from, r);
      g = Sum(tile, down, from + tile.stride, g);
      b = Sum(tile, down, from + 2 * tile.stride, b);
    }
    const auto own = [&](int tiles, hn::Vec<T> sum) HWY_ATTR {
      for (int i = 0; i < tiles; ++i) {
        if (words[3] == 0) {
          sum = SumPoints(words, samples, sum);
          continue;
        }
        const Tile tile = NextTile(words, down);
        sum = Sum(tile, down, samples + tile.offset, sum);
      }
      return sum;
    };
    r = own(pixel.own[0], r);
    g = own(pixel.own[1], g);
    b = own(pixel.own[2], b);
    light[0] += hn::GetLane(hn::SumOfLanes(d, r));
    light[1] += hn::GetLane(hn::SumOfLanes(d, g));
    light[2] += hn::GetLane(hn::SumOfLanes(d, b));
  }
}

// Lanes are rows.
void CutRows(const SlantedGaussian& in, float first_row, const float* weights, RowCuts& cuts) {
  const T d;
  const H half;
  const auto lanes = hn::Iota(d, 0.0f), one = hn::Set(d, 1.0f), last = hn::Set(d, kTileWidth - 1.0f);
  for (size_t r = 0; r < kTileWidth; r += hn::Lanes(d)) {
    const auto away = hn::Add(lanes, hn::Set(d, first_row + static_cast<float>(r)));
    const auto centre = hn::MulAdd(hn::Set(d, in.slope), away, hn::Set(d, in.centre));
    const auto left = hn::NegMulAdd(hn::Mul(away, away), hn::Set(d, in.per_variance), hn::Set(d, in.reach2));
    const auto reach = hn::Mul(hn::Set(d, in.sigma), hn::Sqrt(hn::Max(left, one)));
    auto low = hn::Floor(hn::Sub(centre, reach)), high = hn::Floor(hn::Add(centre, reach));
    // A single sample that would need its own tile is dropped.
    const auto wider = hn::Eq(hn::Sub(high, low), hn::Set(d, kTileWidth));
    const auto from_low = hn::Gt(hn::Sub(centre, low), hn::Sub(hn::Add(high, one), centre));
    low = hn::Add(low, hn::IfThenElseZero(hn::And(wider, from_low), one));
    high = hn::Sub(high, hn::IfThenElseZero(hn::AndNot(from_low, wider), one));
    const auto count = hn::Sub(high, low);  // but one
    const auto start = hn::Sub(hn::Add(low, hn::Set(d, 0.5f)), centre);
    HWY_ALIGN float values[kTileWidth][kTileWidth];
    auto sum = hn::Zero(d), moment = hn::Zero(d);
    for (size_t u = 0; u < kTileWidth; ++u) {
      const auto place = hn::Set(d, static_cast<float>(u));
      const auto a = hn::Add(start, place);
      const auto g = hn::Mul(hn::Set(d, in.peak), hn::Exp(d, hn::Mul(hn::Set(d, in.scale), hn::Mul(a, a))));
      const auto value = hn::IfThenElseZero(hn::Le(place, count), g);
      hn::Store(value, d, values[u]);
      sum = hn::Add(sum, value);
      moment = hn::MulAdd(value, a, moment);
    }
    // The light beyond the reach goes to the end samples, so that sum and centroid are correct.
    const auto beyond = hn::Sub(one, sum);
    const auto after = hn::Div(hn::NegMulSub(beyond, start, moment), count);
    const auto before = hn::Sub(beyond, after);
    const auto weight = hn::LoadU(d, weights + r);
    for (size_t u = 0; u < kTileWidth; ++u) {
      auto value = hn::Load(d, values[u]);
      if (u == 0) value = hn::Add(value, before);
      value = hn::Add(value, hn::IfThenElseZero(hn::Eq(hn::Set(d, static_cast<float>(u)), count), after));
      HWY_ALIGN std::uint16_t column[kTileWidth];
      hn::Store(hn::DemoteTo(half, hn::Mul(value, weight)), half, reinterpret_cast<hwy::float16_t*>(column));
      for (size_t row = 0; row < hn::Lanes(d); ++row) cuts.halves[r + row][u] = column[row];
    }
    hn::StoreU(low, d, &cuts.first[r]);
    // Otherwise the ends are the same sample, or several tiles are needed.
    hn::StoreU(
        hn::IfThenElse(hn::And(hn::Ge(count, one), hn::Le(count, last)), hn::Add(count, one), hn::Zero(d)), d,
        &cuts.count[r]);
  }
}

void SplitRow(const float* interleaved, size_t count, float* r, float* g, float* b) {
  const F d;
  size_t i = 0;
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d)) {
    hn::Vec<F> red, green, blue;
    hn::LoadInterleaved3(d, interleaved + 3 * i, red, green, blue);
    hn::StoreU(red, d, r + i);
    hn::StoreU(green, d, g + i);
    hn::StoreU(blue, d, b + i);
  }
  for (; i < count; ++i) {
    r[i] = interleaved[3 * i];
    g[i] = interleaved[3 * i + 1];
    b[i] = interleaved[3 * i + 2];
  }
}

// Given sums of pairs from the middle outwards.
template <class V>
HWY_INLINE V Blend(const SixTaps& taps, V inner, V middle, V outer) {
  const F d;
  return hn::MulAdd(hn::Set(d, taps.inner), inner,
                    hn::MulAdd(hn::Set(d, taps.middle), middle, hn::Mul(hn::Set(d, taps.outer), outer)));
}

float Blend(const SixTaps& taps, float inner, float middle, float outer) {
  return taps.inner * inner + (taps.middle * middle + taps.outer * outer);
}

void BlendRows(const SixTaps& taps, const float* const* rows, size_t count, float* out) {
  const F d;
  size_t i = 0;
  const auto pair = [&](int a, int b)
                        HWY_ATTR { return hn::Add(hn::LoadU(d, rows[a] + i), hn::LoadU(d, rows[b] + i)); };
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d))
    hn::StoreU(Blend(taps, pair(2, 3), pair(1, 4), pair(0, 5)), d, out + i);
  for (; i < count; ++i)
    out[i] = Blend(taps, rows[2][i] + rows[3][i], rows[1][i] + rows[4][i], rows[0][i] + rows[5][i]);
}

void HalveRow(const SixTaps& taps, const float* in, size_t count, float* out) {
  const F d;
  size_t i = 0;
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d)) {
    hn::Vec<F> v0, v1, v2, v3, v4, v5;
    hn::LoadInterleaved2(d, in + 2 * i, v0, v1);
    hn::LoadInterleaved2(d, in + 2 * i + 2, v2, v3);
    hn::LoadInterleaved2(d, in + 2 * i + 4, v4, v5);
    hn::StoreU(Blend(taps, hn::Add(v2, v3), hn::Add(v1, v4), hn::Add(v0, v5)), d, out + i);
  }
  for (; i < count; ++i) {
    const float* at = in + 2 * i;
    out[i] = Blend(taps, at[2] + at[3], at[1] + at[4], at[0] + at[5]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace glasswing
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace glasswing {

HWY_EXPORT(EvaluateTiles);
HWY_EXPORT(CutRows);
HWY_EXPORT(SplitRow);
HWY_EXPORT(BlendRows);
HWY_EXPORT(HalveRow);

void add_tile(std::uint32_t offset, std::uint16_t stride, std::span<const float> across,
              std::span<const float> down, std::vector<std::uint16_t>& words) {
  const size_t rows = down.size() == 1 ? 0 : down.size(), start = words.size();
  words.resize(start + kTileHeader + kTileWidth + rows);
  std::uint16_t* to = &words[start];
  *to++ = static_cast<std::uint16_t>(offset);
  *to++ = static_cast<std::uint16_t>(offset >> 16);
  *to++ = stride;
  *to++ = static_cast<std::uint16_t>(down.size());
  const float common = rows == 0 ? down.front() : 1.0f;
  for (size_t i = 0; i < across.size(); ++i) to[i] = Imath::half(common * across[i]).bits();
  to += kTileWidth;
  for (size_t i = 0; i < rows; ++i) to[i] = Imath::half(down[i]).bits();
}

int add_points(std::vector<Point>& points, std::vector<std::uint16_t>& words) {
  std::ranges::sort(points, {}, &Point::sample);
  int groups = 0;
  for (auto begin = points.begin(); begin != points.end(); ++groups) {
    constexpr std::uint32_t kFarthest = 0xffff;
    const std::uint32_t offset = begin->sample;
    const auto end = std::find_if(begin, points.end(),
                                  [&](const Point& point) { return point.sample - offset > kFarthest; });
    const auto count = static_cast<size_t>(end - begin);
    const size_t filled = (count + kTileWidth - 1) / kTileWidth * kTileWidth, start = words.size();
    words.resize(start + kTileHeader + 2 * filled);
    std::uint16_t* to = &words[start];
    *to++ = static_cast<std::uint16_t>(offset);
    *to++ = static_cast<std::uint16_t>(offset >> 16);
    *to++ = static_cast<std::uint16_t>(count);
    *to++ = 0;
    for (; begin != end; ++begin, ++to) {
      to[0] = static_cast<std::uint16_t>(begin->sample - offset);
      to[filled] = Imath::half(begin->weight).bits();
    }
  }
  return groups;
}

void add_row_tile(std::uint32_t offset, std::uint16_t stride, const std::uint16_t* across,
                  std::vector<std::uint16_t>& words) {
  const std::array<std::uint16_t, kTileHeader> head{static_cast<std::uint16_t>(offset),
                                                    static_cast<std::uint16_t>(offset >> 16), stride, 1};
  words.insert(words.end(), head.begin(), head.end());
  words.insert(words.end(), across, across + kTileWidth);
}

void cut_rows(const SlantedGaussian& gaussian, float first_row, const float* weights, RowCuts& cuts) {
  HWY_DYNAMIC_DISPATCH(CutRows)(gaussian, first_row, weights, cuts);
}

void evaluate_tiles(std::span<const PixelTiles> pixels, const std::uint16_t* words, const float* samples,
                    float* light) {
  HWY_DYNAMIC_DISPATCH(EvaluateTiles)(pixels.data(), pixels.size(), words, samples, light);
}

void split_row(const float* interleaved, size_t count, float* r, float* g, float* b) {
  HWY_DYNAMIC_DISPATCH(SplitRow)(interleaved, count, r, g, b);
}

void blend_rows(const SixTaps& taps, const float* const rows[6], size_t count, float* out) {
  HWY_DYNAMIC_DISPATCH(BlendRows)(taps, rows, count, out);
}

void halve_row(const SixTaps& taps, const float* in, size_t count, float* out) {
  HWY_DYNAMIC_DISPATCH(HalveRow)(taps, in, count, out);
}

}  // namespace glasswing
#endif
