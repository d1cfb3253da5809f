// A picture at decreasing resolutions, each half of the one above: along both axes
//
//   level_l[j] = sum over k of h[k] level_{l-1}[2j + k - 2],   h = [1 5 10 10 5 1] / 32
//
// A sample of level l lies at the centre of 2^l x 2^l pixels. Its filter has the variance 5 (4^l - 1) / 12
// px^2. Light is conserved: every pixel has the same total weight in a level. Aliases are attenuated by the
// fifth power of their distance from multiples of the sampling frequency. Beyond the picture everything is
// black; a level stores kBorder samples beyond each edge.
//
// A mesh holds what Gaussians of sigma 2^l px see that stand 2 sigma apart, centred at sigma (2i + 1): the
// same with a filter of level l's samples that has the remaining variance, 1 + 4^-l / 2 - 5/12 samples^2
// (footprint_tiles.h). It has the next level's size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/image/image.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {

class PyramidShape {
 public:
  static constexpr int kBorder = 2;
  struct Level {
    int width_px = 0, height_px = 0;
    std::uint16_t stride = 0;  // from one channel's row to the next channel's; a row is three strides
    size_t offset = 0;         // of sample (-kBorder, -kBorder) of the first channel
    // The index of sample (x, y), which may lie up to kBorder beyond the level.
    size_t at(int x, int y, int channel) const {
      return offset + (static_cast<size_t>(y + kBorder) * 3 + channel) * stride +
             static_cast<size_t>(x + kBorder);
    }
  };

  // Samples start at index `offset` of a shared array. No side of the last level exceeds 4 samples.
  PyramidShape(int width_px, int height_px, size_t offset);

  const std::vector<Level>& levels() const { return levels_; }
  // One for each level but the last.
  const std::vector<Level>& meshes() const { return meshes_; }
  size_t end() const { return end_; }

 private:
  std::vector<Level> levels_, meshes_;
  size_t end_ = 0;
};

// Fills levels [0, level_count) of `samples`, and meshes [0, mesh_count), which may be as many. `picture` has
// the shape's size; `mix` converts it from the primaries of texture `texture` to the camera's channels.
void fill_pyramid(const RadianceImage& picture, const PrimaryMix& mix, int texture, const PyramidShape& shape,
                  int level_count, int mesh_count, int thread_count, float* samples);

}  // namespace glasswing
