#include "core/composite/footprint_rows.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

bool is_same(const Mode& a, const Mode& b) {
  return a.weight == b.weight && a.x_px == b.x_px && a.y_px == b.y_px && a.xx_px2 == b.xx_px2 &&
         a.xy_px2 == b.xy_px2 && a.yy_px2 == b.yy_px2 && a.texture == b.texture;
}

}  // namespace

std::vector<FootprintTexture> footprint_textures(const v1::MatteMetadata& metadata) {
  std::vector<FootprintTexture> textures;
  size_t end = 0;
  for (const v1::Monitor& monitor : metadata.monitors()) {
    textures.push_back({.shape = PyramidShape(monitor.width_px(), monitor.height_px(), end)});
    end = textures.back().shape.end();
  }
  return textures;
}

size_t FootprintRow::size_bytes() const {
  return foreground.size() * sizeof(float) + tiles.size() * sizeof(PixelTiles) +
         words.size() * sizeof(std::uint16_t) + boxes.size() * sizeof(WideBox);
}

FootprintRows::FootprintRows(const std::vector<FootprintTexture>& textures, bool boxes, int max_tiles)
    : boxes_(boxes), wide_(textures.size()) {
  for (const FootprintTexture& texture : textures) tiles_.emplace_back(texture.shape, max_tiles);
}

void FootprintRows::prepare(const Matte& matte, int y, FootprintRow& row) {
  row.foreground.clear();
  row.words.clear();
  row.boxes.clear();
  row.tiles.assign(matte.width_px(), {});
  for (int x = 0; x < matte.width_px(); ++x) {
    for (int c = 0; c < kChannels; ++c) row.foreground.push_back(matte.foreground_of_gaussians(x, y, c));
    PixelTiles& pixel = row.tiles[x];
    if (matte.has_pyramid(x, y)) {
      for (int c = 0; c < kChannels; ++c) pixel.own[c] = add_any(matte, x, y, c, row);
      continue;
    }
    const auto modes = [&](int c, size_t m) -> const Mode& { return matte.modes(x, y, c)[m]; };
    const size_t count = matte.modes_per_channel();
    const auto is_shared = [&](size_t m) {
      return matte.is_colourless() ||
             (is_same(modes(0, m), modes(1, m)) && is_same(modes(0, m), modes(2, m)));
    };
    for (size_t m = 0; m < count; ++m) {
      if (is_shared(m)) pixel.shared += add(modes(0, m), 0, true, x, row);
    }
    for (int c = 0; c < kChannels; ++c) {
      for (size_t m = 0; m < count; ++m) {
        if (!is_shared(m)) pixel.own[c] += add(modes(c, m), c, false, x, row);
      }
    }
  }
  row.words.resize(row.words.size() + kTileWidth);  // padding that evaluate_tiles() may read
}

std::uint16_t FootprintRows::add_any(const Matte& matte, int x, int y, int channel, FootprintRow& row) {
  int count = 0;
  for (const Mode& mode : matte.modes_beside_pyramids(x, y, channel))
    count += add(mode, channel, false, x, row);
  for (const PyramidFootprint& pyramid : matte.pyramids(x, y, channel)) {
    const auto texture = static_cast<size_t>(pyramid.texture);
    if (texture < tiles_.size()) count += tiles_[texture].add_pyramid(pyramid, channel, row.words);
  }
  return static_cast<std::uint16_t>(count);
}

std::uint16_t FootprintRows::add(const Mode& mode, int channel, bool shared, int x, FootprintRow& row) {
  const size_t texture = mode.texture;
  if (!(mode.weight > 0.0f) || texture >= tiles_.size()) return 0;
  FootprintTiles& tiles = tiles_[texture];
  if (!boxes_) return static_cast<std::uint16_t>(tiles.add(mode, channel, row.words));
  if (FootprintTiles::is_small_box(mode))
    return static_cast<std::uint16_t>(tiles.add_box(mode, channel, row.words));
  const auto side = [](float variance) { return std::sqrt(12.0f * std::max(variance, 0.0f)); };
  WideBox box{.pixel = x,
              .texture = mode.texture,
              .x_px = mode.x_px,
              .y_px = mode.y_px,
              .width_px = side(mode.xx_px2),
              .height_px = side(mode.yy_px2)};
  if (shared) {
    box.weight.fill(mode.weight);
  } else {
    box.weight[channel] = mode.weight;
  }
  row.boxes.push_back(box);
  wide_[texture] = true;
  return 0;
}

void FootprintRows::report(std::vector<FootprintTexture>& textures) const {
  for (size_t t = 0; t < textures.size(); ++t) {
    textures[t].level_count = std::max(textures[t].level_count, tiles_[t].highest_level() + 1);
    textures[t].mesh_count = std::max(textures[t].mesh_count, tiles_[t].highest_mesh() + 1);
    textures[t].has_wide_boxes = textures[t].has_wide_boxes || wide_[t];
  }
}

BackgroundSamples::BackgroundSamples(const std::vector<FootprintTexture>& textures, const PrimaryMix& mix,
                                     const std::vector<RadianceImage>& backgrounds, int thread_count)
    : mix_(mix),
      samples_(std::make_unique_for_overwrite<float[]>((textures.empty() ? 0 : textures.back().shape.end()) +
                                                       kTileWidth)) {
  for (size_t t = 0; t < textures.size(); ++t) {
    const FootprintTexture& texture = textures[t];
    const RadianceImage* const picture =
        t < backgrounds.size() && !backgrounds[t].empty() ? &backgrounds[t] : nullptr;
    if (picture != nullptr) {
      fill_pyramid(*picture, mix, static_cast<int>(t), texture.shape, texture.level_count, texture.mesh_count,
                   thread_count, samples_.get());
    } else {
      std::fill(samples_.get() + texture.shape.levels().front().offset, samples_.get() + texture.shape.end(),
                0.0f);
    }
    tables_.emplace_back(texture.has_wide_boxes && picture != nullptr ? *picture : RadianceImage(),
                         thread_count);
  }
}

void BackgroundSamples::composite(const FootprintRow& row, std::span<float> light) const {
  std::ranges::copy(row.foreground, light.begin());
  evaluate_tiles(row.tiles, row.words.data(), samples_.get(), light.data());
  for (const WideBox& box : row.boxes) {
    const FastSummedAreaTable::Light seen =
        tables_[box.texture].mean(box.x_px, box.y_px, box.width_px, box.height_px);
    for (size_t c = 0; c < kChannels; ++c)
      light[3 * static_cast<size_t>(box.pixel) + c] += box.weight[c] * seen[c];
  }
  if (mix_.is_unit()) return;
  for (size_t i = 0; i < light.size(); i += 3)
    std::ranges::copy(mix_.primaries({light[i], light[i + 1], light[i + 2]}), light.begin() + i);
}

}  // namespace glasswing
