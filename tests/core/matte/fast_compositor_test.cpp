#include "core/matte/fast_compositor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <fmt/format.h>

#include "core/matte/compositor.h"

namespace glasswing {
namespace {

constexpr int kWidth = 160, kHeight = 120;
// Of full scale, in the mean square over a picture: what the fast compositor is held to.
constexpr double kHeldTo = 0.002;

using Random = std::mt19937;

double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Mode oriented(double x, double y, double sigma_u, double sigma_v, double angle_rad) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad), u = sigma_u * sigma_u, v = sigma_v * sigma_v;
  return {.weight = 1.0f,
          .x_px = static_cast<float>(x),
          .y_px = static_cast<float>(y),
          .xx_px2 = static_cast<float>(c * c * u + s * s * v),
          .xy_px2 = static_cast<float>(c * s * (u - v)),
          .yy_px2 = static_cast<float>(s * s * u + c * c * v)};
}

[[maybe_unused]] Mode round(double x, double y, double sigma) {
  return oriented(x, y, sigma, sigma, 0.0);
}

void add_monitor(Matte& matte, int width, int height, const std::string& name = "back") {
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name(name);
  monitor.set_width_px(width);
  monitor.set_height_px(height);
}

Matte matte_of(int width, int height, const std::function<Mode(Random&)>& mode) {
  Matte matte(0, 0, width, height, 1);
  add_monitor(matte, kWidth, kHeight);
  Random random(3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0] = mode(random);
    }
  }
  return matte;
}

// Every pixel is another gray of its own: harder than any photograph.
RadianceImage noise(int width, int height) {
  Random random(5);
  RadianceImage image(width, height);
  for (float& sample : image.samples) sample = static_cast<float>(uniform(random, 0.0, 1.0));
  return image;
}

double rms(const RadianceImage& a, const RadianceImage& b) {
  double sum = 0.0;
  for (size_t i = 0; i < a.samples.size(); ++i) {
    const double difference = static_cast<double>(a.samples[i]) - static_cast<double>(b.samples[i]);
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(a.samples.size()));
}

TEST(Probe, Widths) {
  const RadianceImage picture = noise(kWidth, kHeight);
  RadianceImage edge(kWidth, kHeight), white(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) for (int x = 0; x < kWidth; ++x) for (int c = 0; c < 3; ++c) {
    edge.at(x, y, c) = ((x / 20 + y / 20) % 2) ? 1.0f : 0.0f;
    white.at(x, y, c) = 1.0f;
  }
  for (const double ratio : {1.0, 2.0}) {
  for (const double sigma : {0.3, 0.5, 0.6, 1.0, 1.6, 1.8, 2.5, 3.2, 3.6,5.0,7.0}) {
    const double major = sigma, minor = sigma / ratio;
    const Matte matte = matte_of(32, 12, [&](Random& random) {
      return oriented(uniform(random, -5, kWidth + 5), uniform(random, -5, kHeight + 5), major, minor, ratio == 1.0 ? 0.0 : uniform(random, 0, 3.2));
    });
    const auto fast = FastCompositor::create(matte).value();
    double e[3]; int i = 0;
    for (const RadianceImage* p : std::initializer_list<const RadianceImage*>{&picture, &edge, &white}) e[i++] = rms(fast.composite({*p}).value(), composite(matte, {*p}).value());
    fmt::print("ratio {:5.1f} sigma {:6.2f}: noise {:.5f} checker {:.5f} white {:.5f}  {:.0f} bytes\n", ratio, sigma, e[0], e[1], e[2],
               static_cast<double>(fast.size_bytes()) / (32 * 12 * 3) - 12./3-8./3);
  }
  }
}

}  // namespace
}  // namespace glasswing
