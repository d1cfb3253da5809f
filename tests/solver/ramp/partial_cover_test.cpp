#include "solver/ramp/partial_cover.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr int kSide_px = 60;

// A disc of one colour in front of another, with each pixel's cover counted by 8x8 rays.
struct Disc {
  std::vector<std::uint16_t> samples;
  std::vector<float> empty, cover;
  std::vector<std::uint8_t> object;

  explicit Disc(double noise_sd = 0.0) {
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0.0, 1.0);
    for (int y = 0; y < kSide_px; ++y) {
      for (int x = 0; x < kSide_px; ++x) {
        int hits = 0;
        for (int ray = 0; ray < 64; ++ray) {
          const double dx = x + (ray % 8 + 0.5) / 8.0 - 30.3, dy = y + (ray / 8 + 0.5) / 8.0 - 29.6;
          if (std::hypot(dx, dy) < 20.0) ++hits;
        }
        const float share = static_cast<float>(hits) / 64.0f;
        cover.push_back(share);
        object.push_back(hits > 0 ? 255 : 0);
        for (const auto& [behind, own] : {std::pair{0.7f, 0.1f}, {0.5f, 0.15f}, {0.4f, 0.05f}}) {
          empty.push_back(behind);
          const float seen =
              (1.0f - share) * behind + share * own + static_cast<float>(noise_sd * noise(random));
          samples.push_back(static_cast<std::uint16_t>(std::lround(65535.0f * seen)));
        }
      }
    }
  }
  std::vector<float> alpha(int edge_px, double noise_variance, int threads = 1) const {
    std::vector<float> alpha(object.size());
    partial_cover(
        {.width_px = kSide_px, .height_px = kSide_px, .light = light(), .empty = empty, .object = object},
        edge_px, noise_variance, threads, alpha);
    return alpha;
  }
  RampLight light() const { return {{.width_px = kSide_px, .height_px = kSide_px, .samples = samples}, {}}; }
};

// Rms error over the pixels at the edge.
double error_of(const Disc& disc, const std::vector<float>& alpha) {
  double squares = 0.0, count = 0.0;
  for (size_t i = 0; i < alpha.size(); ++i) {
    if (disc.cover[i] == 0.0f || disc.cover[i] == 1.0f) continue;
    squares += std::pow(static_cast<double>(alpha[i] - disc.cover[i]), 2);
    count += 1.0;
  }
  return std::sqrt(squares / count);
}

// Where the circle is oblique, up to half of a pixel may be uncovered although all its neighbours are object;
// such pixels keep alpha 1, which brightens the colour just inside of others slightly.
TEST(PartialCover, IsTheShareOfTheObjectInTheLight) {
  const Disc disc;
  const std::vector<float> alpha = disc.alpha(1, 0.0);
  EXPECT_LT(error_of(disc, alpha), 0.2 * error_of(disc, disc.alpha(0, 0.0)));
  for (size_t i = 0; i < alpha.size(); ++i) {
    if (disc.cover[i] == 0.0f || disc.cover[i] == 1.0f) {
      EXPECT_EQ(alpha[i], disc.cover[i]) << i;
    }
  }
}

TEST(PartialCover, WhereTheObjectShowsWhatIsBehindItIsWhole) {
  Disc disc;
  std::ranges::fill(disc.samples, std::uint16_t{30'000});
  std::ranges::fill(disc.empty, disc.light()[0]);
  for (const float alpha : disc.alpha(1, 1e-6)) EXPECT_TRUE(alpha == 0.0f || alpha == 1.0f);
}

TEST(PartialCover, WithoutAnEdgeItIsTheMask) {
  const Disc disc(0.01);
  const std::vector<float> alpha = disc.alpha(0, 1e-4);
  for (size_t i = 0; i < alpha.size(); ++i) EXPECT_EQ(alpha[i], disc.object[i] != 0 ? 1.0f : 0.0f);
}

TEST(PartialCover, DoesNotDependOnThreads) {
  const Disc disc(0.01);
  EXPECT_EQ(disc.alpha(2, 1e-4, 1), disc.alpha(2, 1e-4, 7));
}

}  // namespace
}  // namespace glasswing
