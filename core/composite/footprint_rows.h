// A matte's rows as weights of pyramid samples (footprint_tiles.h), and the samples of the pictures that they
// weight: the two halves of the fast compositor. Boxes wider than a tile are looked up in a
// FastSummedAreaTable.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/composite/footprint_tiles.h"
#include "core/composite/pyramid.h"
#include "core/composite/summed_area_table.h"
#include "core/composite/tile_kernel.h"
#include "core/image/image.h"
#include "core/matte/matte.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {

// Tiles that a footprint may have before it is widened (footprint_tiles.h): no limit in practice.
inline constexpr int kMaxTiles = 1024;

// The parts of the picture on a monitor that footprints need.
struct FootprintTexture {
  PyramidShape shape;
  int level_count = 0;  // levels that tiles use
  int mesh_count = 0;   // meshes that points use
  bool has_wide_boxes = false;
};
// For all monitors, with each one's samples after those of the previous one; nothing is needed yet.
std::vector<FootprintTexture> footprint_textures(const v1::MatteMetadata& metadata);

struct WideBox {
  int pixel = 0, texture = 0;
  float x_px = 0.0f, y_px = 0.0f, width_px = 0.0f, height_px = 0.0f;
  std::array<float, kChannels> weight{};
};

// A row of the camera's picture.
struct FootprintRow {
  std::vector<float> foreground;  // r, g, b per pixel
  std::vector<PixelTiles> tiles;
  std::vector<std::uint16_t> words;
  std::vector<WideBox> boxes;

  size_t size_bytes() const;
};

// Prepares rows; one per thread.
class FootprintRows {
 public:
  // `textures` must outlive it; their shapes are used. `max_tiles`: FootprintTiles'.
  FootprintRows(const std::vector<FootprintTexture>& textures, bool boxes, int max_tiles);

  // Row y of a matte, counted from its first, into `row`, whose memory is reused.
  void prepare(const Matte& matte, int y, FootprintRow& row);
  // Adds the needs of the rows so far.
  void report(std::vector<FootprintTexture>& textures) const;

 private:
  // A channel of a pixel with pyramids.
  std::uint16_t add_any(const Matte& matte, int x, int y, int channel, FootprintRow& row);
  std::uint16_t add(const Mode& mode, int channel, bool shared, int x, FootprintRow& row);

  const bool boxes_;
  std::vector<FootprintTiles> tiles_;  // by texture
  std::vector<bool> wide_;
};

// The pictures behind a matte.
class BackgroundSamples {
 public:
  // `mix` must outlive it. `backgrounds` have been checked (check_backgrounds()).
  BackgroundSamples(const std::vector<FootprintTexture>& textures, const PrimaryMix& mix,
                    const std::vector<RadianceImage>& backgrounds, int thread_count);

  // The composite of a row: r, g, b per pixel. Thread-safe.
  void composite(const FootprintRow& row, std::span<float> light) const;

 private:
  const PrimaryMix& mix_;
  std::unique_ptr<float[]> samples_;
  std::vector<FastSummedAreaTable> tables_;
};

}  // namespace glasswing
