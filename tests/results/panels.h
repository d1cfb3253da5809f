// Pictures side by side with captions above.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

// Radiance encoded for a screen of gamma 2.2, 0 to 255.
std::uint8_t shade(double radiance);
// A picture from a function that returns blue, green and red of each pixel.
cv::Mat painted(int width, int height, const std::function<cv::Vec3b(int, int)>& colour);
cv::Mat shown(const RadianceImage& image);

// All panels have one size; each pixel is drawn `scale` wide. Captions are ASCII.
cv::Mat side_by_side(const std::vector<std::pair<std::string, cv::Mat>>& panels, int scale, int columns);

}  // namespace glasswing
