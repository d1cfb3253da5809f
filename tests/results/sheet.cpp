#include "tests/results/sheet.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace glasswing {
namespace {

constexpr int kScale = 2, kGap = 6, kCaption = 18;

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

cv::Mat difference(const RadianceImage& a, const RadianceImage& b) {
  return painted(a.width_px, a.height_px, [&](int x, int y) {
    const auto at = [&](int c) {
      const size_t i = a.index(x, y, c);
      return shade(8.0 * std::abs(static_cast<double>(a.samples[i] - std::clamp(b.samples[i], 0.0f, 1.0f))));
    };
    return cv::Vec3b(at(2), at(1), at(0));
  });
}

// Green's modes: 1 blue, 2 green, 3 yellow, 4 red.
cv::Mat mode_count(const Matte& matte) {
  const cv::Vec3b colours[] = {{0, 0, 0}, {200, 120, 40}, {60, 170, 60}, {40, 200, 230}, {40, 40, 220}};
  return painted(matte.width_px(), matte.height_px(), [&](int x, int y) {
    if (matte.coverage(x, y) <= 0.0f) return cv::Vec3b(40, 40, 40);
    int count = 0;
    for (const Mode& mode : matte.modes(x, y, 1)) count += mode.weight > 0.0f ? 1 : 0;
    return colours[count];
  });
}

// Of green's strongest mode, white at 16 px; logarithmic.
cv::Mat width(const Matte& matte) {
  return painted(matte.width_px(), matte.height_px(), [&](int x, int y) {
    const Mode& mode = matte.modes(x, y, 1)[0];
    if (matte.coverage(x, y) <= 0.0f || mode.weight <= 0.0f) return cv::Vec3b(40, 40, 40);
    const double sigma_px = std::sqrt(std::max(0.5 * static_cast<double>(mode.xx_px2 + mode.yy_px2), 1e-4));
    const auto level = static_cast<std::uint8_t>(
        std::lround(255.0 * std::clamp(std::log2(1.0 + sigma_px) / std::log2(17.0), 0.0, 1.0)));
    return cv::Vec3b(level, level, level);
  });
}

}  // namespace

void write_sheet(const std::string& path, const RadianceImage& photograph, const RadianceImage& composite,
                 const Matte& matte, bool photographs) {
  std::vector<std::pair<const char*, cv::Mat>> panels{{"photograph", shown(photograph)},
                                                      {"composite", shown(composite)},
                                                      {"difference x 8", difference(photograph, composite)},
                                                      {"modes 1-4", mode_count(matte)},
                                                      {"sigma, 0-16 px", width(matte)}};
  if (!photographs) panels.erase(panels.begin(), panels.begin() + 2);
  const int count = static_cast<int>(panels.size());
  const int w = photograph.width_px * kScale, h = photograph.height_px * kScale;
  cv::Mat sheet(h + kCaption, count * w + (count - 1) * kGap, CV_8UC3, cv::Scalar(255, 255, 255));
  int at = 0;
  for (const auto& [caption, panel] : panels) {
    cv::Mat large;
    cv::resize(panel, large, {w, h}, 0.0, 0.0, cv::INTER_NEAREST);
    large.copyTo(sheet(cv::Rect(at, kCaption, w, h)));
    cv::putText(sheet, caption, {at + 2, kCaption - 5}, cv::FONT_HERSHEY_SIMPLEX, 0.42, cv::Scalar(0, 0, 0),
                1, cv::LINE_AA);
    at += w + kGap;
  }
  cv::imwrite(path, sheet);
}

}  // namespace glasswing
