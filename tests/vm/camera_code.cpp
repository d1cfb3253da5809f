#include "tests/vm/camera_code.h"

#include <cassert>
#include <cmath>

namespace glasswing {
namespace {

double encoded(std::uint16_t sample) {
  const double light = sample / 65535.0;
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
}

}  // namespace

std::vector<std::uint8_t> yuyv_of(const Image16& image) {
  assert(image.width_px % 2 == 0);
  std::vector<std::uint8_t> bytes;
  for (size_t at = 0; at < image.samples.size(); at += 6) {
    double luma[2], cb = 0.0, cr = 0.0;
    for (size_t i = 0; i < 2; ++i) {
      const double red = encoded(image.samples[at + 3 * i]), green = encoded(image.samples[at + 3 * i + 1]),
                   blue = encoded(image.samples[at + 3 * i + 2]);
      luma[i] = 0.299 * red + 0.587 * green + 0.114 * blue;
      cb += (blue - luma[i]) / 1.772 / 2.0;
      cr += (red - luma[i]) / 1.402 / 2.0;
    }
    for (const double code : {16 + 219 * luma[0], 128 + 224 * cb, 16 + 219 * luma[1], 128 + 224 * cr})
      bytes.push_back(static_cast<std::uint8_t>(std::lround(code)));
  }
  return bytes;
}

}  // namespace glasswing
