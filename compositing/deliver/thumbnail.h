// The small picture in a file's header that file managers show.
#pragma once

#include <OpenEXR/ImfPreviewImage.h>

#include <array>
#include <cstddef>
#include <vector>

namespace glasswing {

// Means over squares of a picture of linear light, premultiplied.
class Thumbnail {
 public:
  static constexpr int kMaxSide_px = 256;
  Thumbnail(int width_px, int height_px);

  // Light R, G, B of a pixel, and its coverage.
  void add(int x, int y, const std::array<float, 4>& pixel);
  void join(const Thumbnail& other);  // of the same picture
  Imf::PreviewImage image() const;    // 8 bits of sRGB, and of coverage

 private:
  int width_px_, height_px_, step_, columns_, rows_;
  std::vector<std::array<float, 4>> sums_;
};

}  // namespace glasswing
