#include "core/composite/pyramid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/base/for_rows.h"
#include "core/composite/tile_kernel.h"

namespace glasswing {
namespace {

constexpr int kMinSide_px = 4;

constexpr int kBorder = PyramidShape::kBorder;

void fill_first(const RadianceImage& picture, const PrimaryMix& mix, int texture,
                const PyramidShape::Level& level, int first, int last, float* samples) {
  const size_t width = level.width_px;
  std::vector<float> seen(mix.is_unit() ? 0 : 3 * width);
  for (int y = first; y < last; ++y) {
    std::fill_n(samples + level.at(-kBorder, y, 0), 3 * size_t{level.stride}, 0.0f);
    if (y < 0 || y >= level.height_px) continue;
    const float* from = picture.samples.data() + picture.index(0, y, 0);
    if (!mix.is_unit()) {
      for (size_t i = 0; i < seen.size(); i += 3) {
        const PrimaryMix::Light light = mix.seen(texture, {from[i], from[i + 1], from[i + 2]});
        std::ranges::copy(light, seen.begin() + i);
      }
      from = seen.data();
    }
    split_row(from, width, samples + level.at(0, y, 0), samples + level.at(0, y, 1),
              samples + level.at(0, y, 2));
  }
}

constexpr SixTaps kHalving{.inner = 10.0f / 32.0f, .middle = 5.0f / 32.0f, .outer = 1.0f / 32.0f};

// A Gaussian's values; what is beyond them goes to the outer two, so that light is conserved.
SixTaps mesh_taps(int level) {
  const double variance = 1.0 + 0.5 * std::ldexp(1.0, -2 * level) - 5.0 / 12.0;
  const auto value = [&](double away) {
    return std::exp(-0.5 * away * away / variance) / std::sqrt(2.0 * std::numbers::pi * variance);
  };
  const double inner = value(0.5), middle = value(1.5);
  return {.inner = static_cast<float>(inner),
          .middle = static_cast<float>(middle),
          .outer = static_cast<float>(0.5 - inner - middle)};
}

void fill_next(const SixTaps& taps, const PyramidShape::Level& above, const PyramidShape::Level& level,
               int first, int last, float* samples) {
  const size_t length = above.width_px + 2 * kBorder;
  const size_t kept = level.width_px + 2 * kBorder;
  // The filter of the first stored sample starts this far left of the stored samples of the level above.
  constexpr size_t kLead = kBorder + 2;
  std::vector<float> blended(std::max(kLead + length, 2 * kept + 4)), dark(length);
  for (int y = first; y < last; ++y) {
    for (int c = 0; c < 3; ++c) {
      std::array<const float*, 6> rows{};
      for (int k = 0; k < 6; ++k) {
        const int from = 2 * y + k - 2;
        const bool is_there = from >= -kBorder && from < above.height_px + kBorder;
        rows[k] = is_there ? samples + above.at(-kBorder, from, c) : dark.data();
      }
      blend_rows(taps, rows.data(), length, blended.data() + kLead);
      float* const out = samples + level.at(-kBorder, y, c);
      halve_row(taps, blended.data(), kept, out);
      std::fill(out + kept, out + level.stride, 0.0f);
    }
  }
}

}  // namespace

PyramidShape::PyramidShape(int width_px, int height_px, size_t offset) : end_(offset) {
  const auto add = [&](std::vector<Level>& to) {
    // Room for a tile that starts at the last sample.
    const auto stride = static_cast<std::uint16_t>(width_px + 2 * kBorder + kTileWidth);
    to.push_back({.width_px = width_px, .height_px = height_px, .stride = stride, .offset = end_});
    end_ += static_cast<size_t>(height_px + 2 * kBorder) * 3 * stride;
  };
  add(levels_);
  while (std::max(width_px, height_px) > kMinSide_px) {
    width_px = (width_px + 1) / 2;
    height_px = (height_px + 1) / 2;
    add(levels_);
    add(meshes_);
  }
}

void fill_pyramid(const RadianceImage& picture, const PrimaryMix& mix, int texture, const PyramidShape& shape,
                  int level_count, int mesh_count, int thread_count, float* samples) {
  const auto fill = [&](const PyramidShape::Level& level, const auto& rows) {
    for_rows(level.height_px + 2 * kBorder, thread_count,
             [&](int first, int last) { rows(level, first - kBorder, last - kBorder); });
  };
  for (size_t l = 0; l < static_cast<size_t>(level_count); ++l) {
    fill(shape.levels()[l], [&](const PyramidShape::Level& level, int first, int last) {
      if (l == 0) {
        fill_first(picture, mix, texture, level, first, last, samples);
      } else {
        fill_next(kHalving, shape.levels()[l - 1], level, first, last, samples);
      }
    });
  }
  for (int l = 0; l < mesh_count; ++l) {
    fill(shape.meshes()[l], [&](const PyramidShape::Level& mesh, int first, int last) {
      fill_next(mesh_taps(l), shape.levels()[l], mesh, first, last, samples);
    });
  }
}

}  // namespace glasswing
