#include "client/rig/curve_chart.h"

#include <gtest/gtest.h>

#include <cmath>

namespace glasswing {
namespace {

TEST(CurveChart, DrawsEveryCurveWithNumbersOnly) {
  v1::DisplayCalibration display;
  display.set_monitor("a<b");
  for (int p = 0; p < 3; ++p) {
    v1::ToneCurve& curve = *display.add_primaries();
    curve.set_gamma(2.2);
    for (int k = 0; k < 256; ++k) {
      curve.add_radiance(static_cast<float>(std::pow(k / 255.0, 2.2)));
      curve.add_error(0.001f);
    }
  }
  const std::string svg = chart_of(display);
  EXPECT_NE(svg.find("a&lt;b"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  size_t lines = 0;
  for (size_t at = svg.find("<polyline"); at != std::string::npos; at = svg.find("<polyline", at + 1))
    ++lines;
  EXPECT_EQ(lines, 3u * 4u);  // the curve, its deviation, and the band's two sides
  // An empty calibration still gives a chart.
  EXPECT_NE(chart_of(v1::CameraCalibration()).find("</svg>"), std::string::npos);
}

}  // namespace
}  // namespace glasswing
