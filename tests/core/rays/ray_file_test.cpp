#include "core/rays/ray_file.h"

#include <gtest/gtest.h>

#include <random>

#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

RayMatte random_rays() {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> any(-50.0f, 50.0f);
  RayMatte rays(7, 5, 2);
  rays.metadata.set_format_version(1);
  rays.metadata.add_poses("near");
  rays.metadata.mutable_matte()->set_session("vase");
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      rays.coverage(x, y) = 0.5f;
      rays.flags(x, y) = static_cast<std::uint8_t>(x);
      for (int c = 0; c < kChannels; ++c) {
        rays.foreground(x, y)[c] = any(random);
        for (Ray& ray : rays.rays(x, y, c)) {
          ray.weight = std::abs(any(random));
          ray.origin_mm = {any(random), any(random), any(random)};
          ray.direction = Eigen::Vector3f(any(random), any(random), any(random)).normalized();
          for (Eigen::Vector3f& spread : ray.origin_spread_mm)
            spread = {any(random), any(random), any(random)};
          for (Eigen::Vector3f& spread : ray.direction_spread)
            spread = {any(random), any(random), any(random)};
          ray.origin_sd_mm = 0.25f;
          ray.direction_sd = 0.125f;
          ray.state = static_cast<RayState>(random() % 6);
        }
      }
    }
  }
  return rays;
}

TEST(RayFile, IsReadAsWritten) {
  const RayMatte rays = random_rays();
  const std::string bytes = encode_rays(rays).value();
  EXPECT_TRUE(is_ray_file(bytes));
  const RayMatte read = decode_rays(bytes).value();
  EXPECT_EQ(read.metadata.SerializeAsString(), rays.metadata.SerializeAsString());
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      EXPECT_EQ(read.foreground(x, y), rays.foreground(x, y));
      EXPECT_EQ(read.coverage(x, y), rays.coverage(x, y));
      EXPECT_EQ(read.flags(x, y), rays.flags(x, y));
      for (int c = 0; c < kChannels; ++c) {
        for (size_t r = 0; r < 2; ++r) {
          const Ray &a = rays.rays(x, y, c)[r], &b = read.rays(x, y, c)[r];
          EXPECT_EQ(a.weight, b.weight);
          EXPECT_EQ(a.origin_mm, b.origin_mm);
          EXPECT_EQ(a.direction, b.direction);
          EXPECT_EQ(a.origin_spread_mm, b.origin_spread_mm);
          EXPECT_EQ(a.direction_spread, b.direction_spread);
          EXPECT_EQ(a.origin_sd_mm, b.origin_sd_mm);
          EXPECT_EQ(a.direction_sd, b.direction_sd);
          EXPECT_EQ(a.state, b.state);
        }
      }
    }
  }
  EXPECT_EQ(encode_rays(read).value(), bytes);
}

TEST(RayFile, DamageIsFound) {
  const std::string bytes = encode_rays(random_rays()).value();
  for (const size_t length : {size_t{0}, size_t{10}, bytes.size() / 2, bytes.size() - 1})
    EXPECT_FALSE(decode_rays(bytes.substr(0, length)).ok()) << length;
  std::string altered = bytes;
  altered[altered.size() - 20] = static_cast<char>(altered[altered.size() - 20] ^ 1);
  EXPECT_FALSE(decode_rays(altered).ok());
  Matte matte(0, 0, 2, 2, 1);
  matte.metadata.set_width_px(2);
  matte.metadata.set_height_px(2);
  const std::string other = encode_matte(matte).value();
  EXPECT_FALSE(is_ray_file(other));
  EXPECT_FALSE(decode_rays(other).ok());
  EXPECT_FALSE(decode_matte(bytes).ok());
}

}  // namespace
}  // namespace glasswing
