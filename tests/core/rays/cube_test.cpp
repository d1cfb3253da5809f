#include "core/rays/cube.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace glasswing {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr Cube kFaces{.half_side = 1.25, .side_px = 500};

// Where a direction meets the cube, by intersection.
Vector2d seen_px(const Vector3d& direction, int face) {
  const Vector3d middle = cube_direction(face, 0.0, 0.0);
  const Vector3d at = direction / direction.dot(middle);
  const Vector3d right = cube_direction(face, 1.0, 0.0) - middle,
                 down = cube_direction(face, 0.0, 1.0) - middle;
  return (Vector2d(right.dot(at), down.dot(at)) / kFaces.half_side + Vector2d::Ones()) * 0.5 * kFaces.side_px;
}

TEST(Cube, BundlesHaveTheFootprintOfTheirDirections) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Vector3d(normal(random), normal(random), normal(random)); };
  std::array<int, kCubeFaces> met{};
  for (int i = 0; i < 60; ++i) {
    const Vector3d direction = any().normalized();
    const std::array<Vector3d, 2> spread{0.004 * any(), 0.002 * any()};
    int face = -1;
    const PlaneFootprint footprint = on_cube(kFaces, direction, spread, face);
    ASSERT_TRUE(face >= 0 && face < kCubeFaces);
    ++met[face];
    EXPECT_LT((footprint.centre_px - seen_px(direction, face)).norm(), 1e-9);
    EXPECT_GE(footprint.centre_px.minCoeff(), 50.0 - 1e-9);  // within the cube of half side 1
    EXPECT_LE(footprint.centre_px.maxCoeff(), 450.0 + 1e-9);
    constexpr int kDraws = 4000;
    Matrix2d squares = Matrix2d::Zero();
    for (int k = 0; k < kDraws; ++k) {
      const Vector3d drawn = direction + normal(random) * spread[0] + normal(random) * spread[1];
      const Vector2d off = seen_px(drawn, face) - footprint.centre_px;
      squares += off * off.transpose() / kDraws;
    }
    EXPECT_LT((squares - footprint.covariance_px2).norm(), 0.12 * footprint.covariance_px2.norm());
  }
  for (const int count : met) EXPECT_GT(count, 0);
}

TEST(Cube, AMatteOfDirectionsHasEveryStepsPixelAndAllRays) {
  RayMatte rays(5, 3, 2);
  rays.metadata.mutable_matte()->set_session("vase");
  rays.metadata.mutable_matte()->add_crosstalk()->add_share(1.0);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) {
      rays.foreground(x, y) = {0.01f * static_cast<float>(x), 0.02f * static_cast<float>(y), 0.5f};
      rays.flags(x, y) = x == 2 && y == 2 ? kFlagNoData : kFlagNone;
      Ray& ray = rays.rays(x, y, 1)[1];  // the first is not used
      ray.weight = 0.75f;
      ray.direction = Eigen::Vector3f(0.0f, -1.0f, 0.0f);
      ray.direction_spread[0] = {0.01f, 0.0f, 0.0f};
    }
  }
  const Matte matte = matte_of_directions(rays, {.half_side = 1.0, .side_px = 200}, 2);
  ASSERT_EQ(matte.width_px(), 3);
  ASSERT_EQ(matte.height_px(), 2);
  EXPECT_EQ(matte.metadata.session(), "vase");
  ASSERT_EQ(matte.metadata.monitors_size(), kCubeFaces);
  EXPECT_EQ(matte.metadata.monitors(3).name(), "-y");
  EXPECT_EQ(matte.metadata.crosstalk_size(), kCubeFaces);
  EXPECT_EQ(matte.foreground(2, 1), rays.foreground(4, 2));
  EXPECT_EQ(matte.flags(1, 1), kFlagNoData);
  EXPECT_EQ(matte.modes(0, 0, 0)[1].weight, 0.0f);
  const Mode& mode = matte.modes(2, 1, 1)[1];
  EXPECT_EQ(mode.weight, 0.75f);
  EXPECT_EQ(mode.texture, 3);
  EXPECT_FLOAT_EQ(mode.x_px, 100.0f);
  EXPECT_FLOAT_EQ(mode.xx_px2, 0.0f);  // the face's x is z, its y is x
  EXPECT_FLOAT_EQ(mode.yy_px2, 1.0f);
}

TEST(Cube, WhatALosslessObjectSendsFromEverywhereIsOneBundleMore) {
  RayMatte rays(2, 1, 1);
  rays.coverage(0, 0) = 1.0f;
  for (int x = 0; x < 2; ++x) {
    rays.rays(x, 0, 2)[0].weight = 0.75f;
    rays.rays(x, 0, 2)[0].direction = Eigen::Vector3f::UnitX();
  }
  const Matte matte = matte_of_directions(rays, {.half_side = 1.0, .side_px = 200}, 1, true);
  ASSERT_EQ(matte.modes_per_channel(), 2);
  EXPECT_FLOAT_EQ(matte.modes(0, 0, 0)[1].weight, 1.0f);
  EXPECT_FLOAT_EQ(matte.modes(0, 0, 2)[1].weight, 0.25f);
  EXPECT_FLOAT_EQ(matte.modes(0, 0, 2)[1].xx_px2, 400.0f * 400.0f);
  EXPECT_EQ(matte.modes(1, 0, 2)[1].weight, 0.0f);  // beside the object
}

}  // namespace
}  // namespace glasswing
