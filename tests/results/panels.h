// Pictures side by side, each below its caption.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/frame/image.h"

namespace glasswing {

// Radiance as a screen of gamma 2.2 wants it, of 255.
std::uint8_t shade(double radiance);
// By blue, green and red of each pixel.
cv::Mat painted(int width, int height, const std::function<cv::Vec3b(int, int)>& colour);
cv::Mat shown(const RadianceImage& image);

// Of one size each, a pixel `scale` wide, so many in a line. Captions are ASCII.
cv::Mat side_by_side(const std::vector<std::pair<std::string, cv::Mat>>& panels, int scale, int columns);

}  // namespace glasswing
