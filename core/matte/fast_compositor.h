// The compositor for many pictures behind one matte, such as a video. Matches composite() (compositor.h)
// within 0.002 of full scale, rms.
//
// The matte is converted once to weights of the samples of a pyramid (footprint_tiles.h); each picture then
// costs a pyramid and the products. Boxes wider than a tile are looked up in a FastSummedAreaTable.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/frame/image.h"
#include "core/matte/matte.h"
#include "core/matte/pyramid.h"
#include "core/matte/tile_kernel.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {

class FastCompositor {
 public:
  // Takes about 40 bytes per mode and channel; long, narrow, oblique footprints take as much per row that
  // they touch, and lose sharpness if the total would exceed 2 GiB. `thread_count` 0: all cores.
  // INVALID_ARGUMENT: the matte's crosstalk is invalid.
  static absl::StatusOr<FastCompositor> create(const Matte& matte, int thread_count = 0,
                                               const std::function<void(double)>& progress = nullptr);

  // As glasswing::composite() of this matte. The result does not depend on `thread_count`.
  absl::StatusOr<RadianceImage> composite(const std::vector<RadianceImage>& backgrounds,
                                          int thread_count = 0) const;

  // The size of the weights.
  size_t size_bytes() const;

 private:
  struct Texture {
    PyramidShape shape;
    int level_count = 0;  // levels that tiles use
    bool has_wide_boxes = false;
  };
  struct WideBox {
    int pixel = 0, texture = 0;
    float x_px = 0.0f, y_px = 0.0f, width_px = 0.0f, height_px = 0.0f;
    std::array<float, kChannels> weight{};
  };
  // A row of the camera's picture.
  struct Row {
    std::vector<float> foreground;
    std::vector<PixelTiles> tiles;
    std::vector<std::uint16_t> words;
    std::vector<WideBox> boxes;
  };
  class Preparation;

  FastCompositor(v1::MatteMetadata metadata, PrimaryMix mix)
      : metadata_(std::move(metadata)), mix_(std::move(mix)) {}

  v1::MatteMetadata metadata_;
  PrimaryMix mix_;
  int width_px_ = 0;
  std::vector<Texture> textures_;
  std::vector<Row> rows_;
};

}  // namespace glasswing
