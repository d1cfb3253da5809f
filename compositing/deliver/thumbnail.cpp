#include "compositing/deliver/thumbnail.h"

#include <algorithm>
#include <cmath>

#include "core/image/image_file.h"

namespace glasswing {

Thumbnail::Thumbnail(int width_px, int height_px)
    : width_px_(width_px),
      height_px_(height_px),
      step_((std::max(width_px, height_px) + kMaxSide_px - 1) / kMaxSide_px),
      columns_((width_px + step_ - 1) / step_),
      rows_((height_px + step_ - 1) / step_),
      sums_(static_cast<size_t>(columns_) * rows_) {}

void Thumbnail::add(int x, int y, const std::array<float, 4>& pixel) {
  std::array<float, 4>& sum =
      sums_[static_cast<size_t>(y / step_) * columns_ + static_cast<size_t>(x / step_)];
  for (size_t i = 0; i < pixel.size(); ++i) sum[i] += pixel[i];
}

void Thumbnail::join(const Thumbnail& other) {
  for (size_t at = 0; at < sums_.size(); ++at) {
    for (size_t i = 0; i < sums_[at].size(); ++i) sums_[at][i] += other.sums_[at][i];
  }
}

Imf::PreviewImage Thumbnail::image() const {
  Imf::PreviewImage image(static_cast<unsigned>(columns_), static_cast<unsigned>(rows_));
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const int count =
          std::min(step_, width_px_ - column * step_) * std::min(step_, height_px_ - row * step_);
      std::array<float, 4> mean = sums_[static_cast<size_t>(row) * columns_ + column];
      for (float& value : mean) value /= static_cast<float>(count);
      const auto code = [](float value) {
        return static_cast<unsigned char>(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f)));
      };
      image.pixel(static_cast<unsigned>(column), static_cast<unsigned>(row)) =
          Imf::PreviewRgba(code(srgb_of_linear(mean[0])), code(srgb_of_linear(mean[1])),
                           code(srgb_of_linear(mean[2])), code(mean[3]));
    }
  }
  return image;
}

}  // namespace glasswing
