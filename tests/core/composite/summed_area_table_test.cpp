#include "core/composite/summed_area_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

RadianceImage random_picture(int width, int height) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> light(0.0f, 1.0f);
  RadianceImage image(width, height);
  for (float& sample : image.samples) sample = light(random);
  return image;
}

struct Box {
  double x, y, width, height;
  Mode mode() const {
    return {.weight = 1.0f,
            .x_px = static_cast<float>(x),
            .y_px = static_cast<float>(y),
            .xx_px2 = static_cast<float>(width * width / 12.0),
            .yy_px2 = static_cast<float>(height * height / 12.0)};
  }
};

double overlap(int pixel, double centre, double length) {
  return std::max(
      std::min(pixel + 1.0, centre + 0.5 * length) - std::max<double>(pixel, centre - 0.5 * length), 0.0);
}

// Sums over pixels, weighted by the shared area.
double brute_force(const Box& box, const RadianceImage& picture, int channel) {
  double sum = 0.0;
  for (int y = 0; y < picture.height_px; ++y) {
    for (int x = 0; x < picture.width_px; ++x) {
      sum += overlap(x, box.x, box.width) * overlap(y, box.y, box.height) *
             static_cast<double>(picture.at(x, y, channel));
    }
  }
  return sum / (box.width * box.height);
}

// Small and large boxes, within the picture, across its edge, and beyond it.
TEST(SummedAreaTable, AgreesWithBruteForce) {
  const RadianceImage picture = random_picture(40, 30);
  const SummedAreaTable summed(picture);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 400; ++i) {
    const Box box{-5.0 + 50.0 * unit(random), -5.0 + 40.0 * unit(random),
                  0.02 + 45.0 * std::pow(unit(random), 4), 0.02 + 35.0 * std::pow(unit(random), 4)};
    // The floats of a mode locate an edge at 50 px within 4e-6 px, which is 2e-4 of a side of 0.02 px at each
    // end.
    EXPECT_NEAR(summed.mean(box.mode(), i % 3), brute_force(box, picture, i % 3), 5e-4) << i;
  }
}

TEST(SummedAreaTable, PointsAndLinesAreTakenAsTheyAre) {
  const RadianceImage picture = random_picture(16, 12);
  const SummedAreaTable summed(picture);
  EXPECT_EQ(summed.mean(Box{3.5, 9.5, 0.0, 0.0}.mode(), 2), static_cast<double>(picture.at(3, 9, 2)));
  EXPECT_EQ(summed.mean(Box{-0.5, 9.5, 0.0, 0.0}.mode(), 2), 0.0);
  EXPECT_EQ(summed.mean(Box{3.5, 12.0, 0.0, 0.0}.mode(), 2), 0.0);
  double line = 0.0;
  for (int x = 0; x < 16; ++x) line += static_cast<double>(picture.at(x, 9, 1)) / 16.0;
  EXPECT_NEAR(summed.mean(Box{8.0, 9.5, 16.0, 0.0}.mode(), 1), line, 1e-6);
  EXPECT_EQ(SummedAreaTable(RadianceImage()).mean(Box{3.5, 9.5, 2.0, 2.0}.mode(), 0), 0.0);
}

// The part of a box beyond the edge is dark, and counts in the mean.
TEST(SummedAreaTable, BeyondTheEdgeIsNothing) {
  RadianceImage flat(20, 20);
  for (float& sample : flat.samples) sample = 0.5f;
  const SummedAreaTable summed(flat);
  EXPECT_NEAR(summed.mean(Box{0.0, 10.0, 12.0, 12.0}.mode(), 0), 0.25, 1e-6);
  EXPECT_NEAR(summed.mean(Box{20.0, 20.0, 12.0, 12.0}.mode(), 0), 0.125, 1e-6);
  EXPECT_NEAR(summed.mean(Box{10.0, 10.0, 40.0, 40.0}.mode(), 0), 0.125, 1e-6);
}

}  // namespace
}  // namespace glasswing
