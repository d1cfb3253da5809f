// The compositor for many pictures behind one matte, such as a video: what composite() (compositor.h) gives,
// within 0.002 of full scale in the mean square.
//
// A matte is made once into weights of the samples of a pyramid (footprint_tiles.h); a picture costs a
// pyramid and the products. Boxes wider than a tile are looked up in a table of sums.
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
  // Takes some 40 bytes a mode and channel, and of long, narrow and oblique footprints as many a row that
  // they touch; these lose sharpness rather than that all take more than 2 GiB. `thread_count` 0: all cores.
  // INVALID_ARGUMENT: the matte's crosstalk cannot be one.
  static absl::StatusOr<FastCompositor> create(const Matte& matte, int thread_count = 0,
                                               const std::function<void(double)>& progress = nullptr);

  // As composite(), of the matte that it was created for. The result does not depend on `thread_count`.
  absl::StatusOr<RadianceImage> composite(const std::vector<RadianceImage>& backgrounds,
                                          int thread_count = 0) const;

  // What the weights take.
  size_t size_bytes() const;

 private:
  struct Texture {
    PyramidShape shape;
    int level_count = 0;  // that tiles are of
    bool has_wide_boxes = false;
  };
  struct WideBox {
    int pixel = 0, texture = 0;
    float x_px = 0.0f, y_px = 0.0f, width_px = 0.0f, height_px = 0.0f;
    std::array<float, kChannels> weight{};
  };
  // Of the camera's picture.
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
