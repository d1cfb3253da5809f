// A picture at ever lower resolution, each half of the one above: along both axes
//
//   level_l[j] = sum over k of h[k] level_{l-1}[2j + k - 2],   h = [1 5 10 10 5 1] / 32
//
// A sample of level l lies in the middle of 2^l x 2^l pixels. Its filter has the variance 5 (4^l - 1) / 12
// px^2, and no light is lost: every pixel has the same part in all of a level. Waves that a level cannot show
// are left by the fifth power of their distance from multiples of its sampling frequency. Beyond the picture
// it is dark; so is a level, but for kBorder samples beyond each edge, which are kept.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/frame/image.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {

class PyramidShape {
 public:
  static constexpr int kBorder = 2;
  struct Level {
    int width_px = 0, height_px = 0;
    std::uint16_t stride = 0;  // from a channel's row to the next channel's; three are a row
    size_t offset = 0;         // of sample (-kBorder, -kBorder) of the first channel
    // Of sample (x, y), each at most kBorder beyond the level.
    size_t at(int x, int y, int channel) const {
      return offset + (static_cast<size_t>(y + kBorder) * 3 + static_cast<size_t>(channel)) * stride +
             static_cast<size_t>(x + kBorder);
    }
  };

  // Its samples begin at `offset` of a larger whole. The last level has no side above 4 samples.
  PyramidShape(int width_px, int height_px, size_t offset);

  const std::vector<Level>& levels() const { return levels_; }
  size_t end() const { return end_; }

 private:
  std::vector<Level> levels_;
  size_t end_ = 0;
};

// Fills the levels [0, level_count) of `samples`, and nothing else. `picture` has the shape's size; it is
// taken as the camera's channels see texture `texture` where `mix` says that they mix primaries.
void fill_pyramid(const RadianceImage& picture, const PrimaryMix& mix, int texture, const PyramidShape& shape,
                  int level_count, int thread_count, float* samples);

}  // namespace glasswing
