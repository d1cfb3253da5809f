#include "tests/results/sheet.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "tests/results/panels.h"

namespace glasswing {
namespace {

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

// The width of green's strongest mode, white at 16 px; logarithmic.
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
  std::vector<std::pair<std::string, cv::Mat>> panels{{"photograph", shown(photograph)},
                                                      {"composite", shown(composite)},
                                                      {"difference x 8", difference(photograph, composite)},
                                                      {"modes 1-4", mode_count(matte)},
                                                      {"sigma, 0-16 px", width(matte)}};
  if (!photographs) panels.erase(panels.begin(), panels.begin() + 2);
  cv::imwrite(path, side_by_side(panels, 2, static_cast<int>(panels.size())));
}

}  // namespace glasswing
