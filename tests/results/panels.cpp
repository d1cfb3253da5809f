#include "tests/results/panels.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace glasswing {
namespace {

constexpr int kGap = 6, kCaption = 18;

}  // namespace

std::uint8_t shade(double radiance) {
  return static_cast<std::uint8_t>(std::lround(255.0 * std::pow(std::clamp(radiance, 0.0, 1.0), 1.0 / 2.2)));
}

cv::Mat painted(int width, int height, const std::function<cv::Vec3b(int, int)>& colour) {
  cv::Mat picture(height, width, CV_8UC3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) picture.at<cv::Vec3b>(y, x) = colour(x, y);
  }
  return picture;
}

cv::Mat shown(const RadianceImage& image) {
  return painted(image.width_px, image.height_px, [&](int x, int y) {
    const auto at = [&](int c) { return shade(static_cast<double>(image.samples[image.index(x, y, c)])); };
    return cv::Vec3b(at(2), at(1), at(0));
  });
}

cv::Mat side_by_side(const std::vector<std::pair<std::string, cv::Mat>>& panels, int scale, int columns) {
  const int count = static_cast<int>(panels.size());
  columns = std::min(columns, count);
  const int lines = (count + columns - 1) / columns;
  const int w = panels.front().second.cols * scale, h = panels.front().second.rows * scale;
  cv::Mat sheet(lines * (h + kCaption + kGap) - kGap, columns * (w + kGap) - kGap, CV_8UC3,
                cv::Scalar(255, 255, 255));
  for (int i = 0; i < count; ++i) {
    const auto& [caption, panel] = panels[i];
    const int x = i % columns * (w + kGap), y = i / columns * (h + kCaption + kGap) + kCaption;
    cv::Mat large;
    cv::resize(panel, large, {w, h}, 0.0, 0.0, cv::INTER_NEAREST);
    large.copyTo(sheet(cv::Rect(x, y, w, h)));
    cv::putText(sheet, caption, {x + 2, y - 5}, cv::FONT_HERSHEY_SIMPLEX, 0.42, cv::Scalar(0, 0, 0), 1,
                cv::LINE_AA);
  }
  return sheet;
}

}  // namespace glasswing
