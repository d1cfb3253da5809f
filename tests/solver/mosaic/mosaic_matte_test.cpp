#include "solver/mosaic/mosaic_matte.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "solver/mosaic/edge_fit.h"

namespace glasswing {
namespace {

constexpr int kWidth = 24, kHeight = 20;

Mosaic rggb() {
  return Mosaic::parse("RGGB").value();
}

// All modes of a pixel's channel; a truth.
using Truth = std::function<std::vector<Mode>(int x, int y, int channel)>;

// What a mosaic shows of it.
Matte measured(const Truth& truth) {
  Matte matte(0, 0, kWidth, kHeight, 4);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_width_px(400);
  monitor.set_height_px(300);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const int own = rggb().channel(x, y);
      const std::vector<Mode> modes = truth(x, y, own);
      std::ranges::copy(modes, matte.modes(x, y, own).begin());
      matte.foreground(x, y)[own] = 0.01f * static_cast<float>(own + 1);
      matte.coverage(x, y) = 1.0f;
    }
  }
  return matte;
}

Matte filled(const Truth& truth) {
  Matte matte = measured(truth);
  fill_channels(matte, rggb());
  return matte;
}

Mode mode_at(double x_px, double y_px, double weight, double variance_px2 = 0.3) {
  return {.weight = static_cast<float>(weight),
          .x_px = static_cast<float>(x_px),
          .y_px = static_cast<float>(y_px),
          .xx_px2 = static_cast<float>(variance_px2),
          .xy_px2 = 0.0f,
          .yy_px2 = static_cast<float>(variance_px2),
          .texture = 0,
          .weight_sd = 0.001f,
          .centre_sd_px = 0.01f};
}

bool is_rim(int x, int y) {
  return x < 3 || y < 3 || x >= kWidth - 3 || y >= kHeight - 3;
}

void expect_same(const Mode& a, const Mode& b) {
  EXPECT_EQ(a.weight, b.weight);
  EXPECT_EQ(a.x_px, b.x_px);
  EXPECT_EQ(a.y_px, b.y_px);
  EXPECT_EQ(a.xx_px2, b.xx_px2);
  EXPECT_EQ(a.weight_sd, b.weight_sd);
}

// A prism: a plane of places, moved by dispersion, and each channel with a loss of its own.
TEST(MosaicMatte, APlaneWithDispersionIsExact) {
  const Truth prism = [](int x, int y, int c) {
    return std::vector<Mode>{
        mode_at(80.0 + 1.7 * x - 0.4 * y + 9.0 * c, 60.0 + 0.3 * x + 2.1 * y - 4.0 * c, 0.9 - 0.2 * c)};
  };
  const Matte matte = filled(prism);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        const Mode expected = prism(x, y, c).front(), &found = matte.modes(x, y, c)[0];
        SCOPED_TRACE(testing::Message() << x << "," << y << " " << c);
        EXPECT_NEAR(found.weight, expected.weight, 1e-5);
        // Donors lie evenly around but for the picture's rim, where the slopes' ridge shows.
        EXPECT_NEAR(found.x_px, expected.x_px, is_rim(x, y) ? 0.03 : 1e-3);
        EXPECT_NEAR(found.y_px, expected.y_px, is_rim(x, y) ? 0.03 : 1e-3);
        EXPECT_EQ(matte.modes(x, y, c)[1].weight, 0.0f);
        EXPECT_NEAR(matte.foreground(x, y)[c], 0.01 * (c + 1), 1e-6);
        if (c == rggb().channel(x, y)) {
          expect_same(found, expected);
        } else {
          EXPECT_EQ(found.weight_sd, 0.0f);
          EXPECT_EQ(found.centre_sd_px, 0.0f);
        }
      }
    }
  }
}

// A smooth lens: place = p + k p^2 along x and y. The mean of sites at +-d, each moved along the slope, is
// off by k d^2, d^2 at most 1 along an axis, as robust weights hardly tell.
TEST(MosaicMatte, ALensIsOffByItsCurvatureOnly) {
  constexpr double kCurvature = 0.02;
  const Truth lens = [](int x, int y, int c) {
    const double u = x - 0.5 * kWidth, v = y - 0.5 * kHeight;
    return std::vector<Mode>{mode_at(200.0 + 2.0 * u + kCurvature * u * u + 2.0 * c,
                                     150.0 + 1.5 * v - kCurvature * v * v - c, 0.8)};
  };
  const Matte matte = filled(lens);
  for (int y = 3; y < kHeight - 3; ++y) {
    for (int x = 3; x < kWidth - 3; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        const Mode expected = lens(x, y, c).front(), &found = matte.modes(x, y, c)[0];
        EXPECT_NEAR(found.x_px, expected.x_px, 1.5 * kCurvature) << x << "," << y << " " << c;
        EXPECT_NEAR(found.y_px, expected.y_px, 1.5 * kCurvature) << x << "," << y << " " << c;
        EXPECT_NEAR(found.weight, 0.8, 1e-5);
      }
    }
  }
}

// Two facets that meet in a line that is not along the sites; pixels on it see both.
std::vector<Mode> facets(int x, int y, int c, double shift_px) {
  const double nx = 0.8, ny = 0.6;
  const double part =
      std::clamp(0.5 + (nx * (x - 12.0) + ny * (y - 10.0) - shift_px * c) / (nx + ny), 0.0, 1.0);
  std::vector<Mode> modes;
  if (part > 0.0) modes.push_back(mode_at(100.0 + 1.2 * x + 3.0 * c, 80.0 + 1.1 * y, 0.9 * part));
  if (part < 1.0) modes.push_back(mode_at(260.0 + 0.8 * x - 2.0 * c, 200.0 + 1.4 * y, 0.9 * (1.0 - part)));
  return modes;
}

TEST(MosaicMatte, PathsOnBothSidesOfAnEdgeAreNotMixed) {
  for (const double shift_px : {0.0, 0.7}) {
    const Truth truth = [&](int x, int y, int c) { return facets(x, y, c, shift_px); };
    const Matte matte = filled(truth);
    double squares = 0.0, count = 0.0;
    for (int y = 3; y < kHeight - 3; ++y) {
      for (int x = 3; x < kWidth - 3; ++x) {
        for (int c = 0; c < kChannels; ++c) {
          double of_first = 0.0, whole = 0.0;
          for (const Mode& mode : matte.modes(x, y, c)) {
            if (mode.weight == 0.0f) continue;
            const double first_px = std::hypot(mode.x_px - (100.0 + 1.2 * x + 3.0 * c),
                                               mode.y_px - (80.0 + 1.1 * y)),
                         second_px = std::hypot(mode.x_px - (260.0 + 0.8 * x - 2.0 * c),
                                                mode.y_px - (200.0 + 1.4 * y));
            EXPECT_LT(std::min(first_px, second_px), 0.05) << x << "," << y << " " << c;
            whole += static_cast<double>(mode.weight);
            of_first += first_px < second_px ? static_cast<double>(mode.weight) : 0.0;
          }
          EXPECT_NEAR(whole, 0.9, 0.1);
          double expected = 0.0;
          for (const Mode& mode : truth(x, y, c))
            expected += mode.x_px < 190.0f ? static_cast<double>(mode.weight) : 0.0;
          if (expected > 0.0 && expected < 0.9) {
            squares += std::pow(of_first - expected, 2.0);
            count += 1.0;
          }
        }
      }
    }
    // The mean of the sites beside would be off by 0.2.
    EXPECT_LT(std::sqrt(squares / count), 0.1) << shift_px;
  }
}

// A pixel's result depends on kMosaicReach rows around it.
TEST(MosaicMatte, TilesWithAMarginJoinToTheWhole) {
  const Truth truth = [](int x, int y, int c) { return facets(x, y, c, 0.7); };
  const Matte whole = filled(truth), native = measured(truth);
  for (int first = 0; first < kHeight; first += 5) {
    const int from = std::max(first - kMosaicReach, 0), to = std::min(first + 5 + kMosaicReach, kHeight);
    Matte tile = rows_of(native, from, to - from);
    fill_channels(tile, rggb(), 1);
    const Matte rows = rows_of(tile, first - from, 5);
    EXPECT_EQ(rows.y0_px(), first);
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        EXPECT_EQ(rows.foreground(x, y), whole.foreground(x, first + y));
        for (int c = 0; c < kChannels; ++c) {
          for (size_t m = 0; m < 4; ++m) expect_same(rows.modes(x, y, c)[m], whole.modes(x, first + y, c)[m]);
        }
      }
    }
  }
}

TEST(MosaicMatte, PixelsThatAreNotSolvedTellNothing) {
  const Truth truth = [](int x, int y, int) { return std::vector<Mode>{mode_at(100.0 + x, 90.0 + y, 0.7)}; };
  Matte matte = measured(truth);
  matte.flags(8, 8) = kFlagNoData;
  matte.modes(8, 8, 0)[0] = mode_at(10.0, 10.0, 1.0);
  fill_channels(matte, rggb());
  EXPECT_EQ(matte.modes(8, 8, 1)[0].weight, 0.0f);
  EXPECT_NEAR(matte.modes(9, 8, 0)[0].x_px, 109.0f, 0.05f);
  EXPECT_EQ(matte.modes(9, 8, 0)[1].weight, 0.0f);
}

TEST(EdgeFit, FindsAnEdgeThatDispersionMoves) {
  for (const double angle : {0.0, 0.4, 1.1, 2.3, 4.0}) {
    const double nx = std::cos(angle), ny = std::sin(angle);
    const std::array<double, 3> edge_px{0.2, -0.3, -0.8};
    const auto part = [&](int dx, int dy, int c) {
      return std::clamp(0.5 + (nx * dx + ny * dy - edge_px[c]) / (std::abs(nx) + std::abs(ny)), 0.0, 1.0);
    };
    std::vector<EdgeSample> samples;
    for (int dy = -kEdgeReach; dy <= kEdgeReach; ++dy) {
      for (int dx = -kEdgeReach; dx <= kEdgeReach; ++dx) {
        const int c = rggb().channel(dx + 2, dy + 2);
        samples.push_back({.dx = dx, .dy = dy, .channel = c, .part = part(dx, dy, c)});
      }
    }
    // Distances are tried every 0.25 px, directions every 11 degrees.
    for (const int c : {1, 2})
      EXPECT_NEAR(part_by_edge(samples, 0, c), part(0, 0, c), 0.2) << angle << " " << c;
  }
}

}  // namespace
}  // namespace glasswing
