#include "solver/ramp/partial_cover.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/for_rows.h"
#include "solver/ramp/byte_runs.h"

namespace glasswing {

void partial_cover(const CoverPictures& pictures, int edge_px, double noise_variance, int thread_count,
                   std::span<float> alpha) {
  const int width = pictures.width_px, height = pictures.height_px;
  const cv::Mat object(height, width, CV_8U, const_cast<std::uint8_t*>(pictures.object.data()));
  cv::Mat inner = object;
  if (edge_px > 0) {  // the picture's border is not an edge of the object
    inner = cv::Mat();
    cv::erode(object, inner, cv::getStructuringElement(cv::MORPH_CROSS, {3, 3}), {-1, -1}, edge_px);
  }
  const cv::Mat edge = object - inner;
  const int reach = edge_px + 1;
  const auto cover = [&](int x, int y) {
    const auto place = [&](int column, int row) { return (static_cast<size_t>(row) * width + column) * 3; };
    std::array<float, 3> own{};
    float weights = 0.0f;
    for (int row = std::max(y - reach, 0); row <= std::min(y + reach, height - 1); ++row) {
      for (int column = std::max(x - reach, 0); column <= std::min(x + reach, width - 1); ++column) {
        if (inner.at<std::uint8_t>(row, column) == 0) continue;
        const int dx = column - x, dy = row - y;
        const float weight = 1.0f / static_cast<float>(dx * dx + dy * dy);
        weights += weight;
        for (size_t c = 0; c < 3; ++c) own[c] += weight * pictures.light[place(column, row) + c];
      }
    }
    if (weights == 0.0f) return 1.0f;  // the object is thinner than its edges
    // Shrinks towards 1: a prior with the weight of one standard deviation of noise.
    float along = static_cast<float>(noise_variance), square = along;
    for (size_t c = 0; c < 3; ++c) {
      const float empty = pictures.empty[place(x, y) + c], span = empty - own[c] / weights;
      along += (empty - pictures.light[place(x, y) + c]) * span;
      square += span * span;
    }
    return square > 0.0f ? std::clamp(along / square, 0.0f, 1.0f) : 1.0f;
  };
  for_rows(height, thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      const std::uint8_t* const core = inner.ptr(y);
      float* const row = alpha.data() + static_cast<size_t>(y) * width;
      for (int x = 0; x < width; ++x) row[x] = core[x] != 0 ? 1.0f : 0.0f;
      // Few pixels lie at an edge.
      const std::uint8_t *at = edge.ptr(y), *const end = at + width;
      while ((at = next_set(at, end)) != end) {
        const auto x = static_cast<int>(at++ - edge.ptr(y));
        row[x] = cover(x, y);
      }
    }
  });
}

}  // namespace glasswing
