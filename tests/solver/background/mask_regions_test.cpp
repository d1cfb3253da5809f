#include "solver/background/mask_regions.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace glasswing {
namespace {

constexpr int kWidth = 23, kHeight = 17;
using Samples = std::vector<std::uint8_t>;

// Visits every pixel of the first one's region. `corners`: corners connect too.
std::vector<size_t> region_at(const Samples& samples, size_t first, bool corners) {
  std::vector<size_t> region = {first};
  std::vector<bool> seen(samples.size());
  seen[first] = true;
  for (size_t i = 0; i < region.size(); ++i) {
    const int x = static_cast<int>(region[i]) % kWidth, y = static_cast<int>(region[i]) / kWidth;
    for (int v = y - 1; v <= y + 1; ++v) {
      for (int u = x - 1; u <= x + 1; ++u) {
        if (u < 0 || v < 0 || u >= kWidth || v >= kHeight || (!corners && u != x && v != y)) continue;
        const size_t next = v * kWidth + u;
        if (seen[next] || samples[next] != samples[first]) continue;
        seen[next] = true;
        region.push_back(next);
      }
    }
  }
  return region;
}

Samples random_mask(unsigned seed) {
  std::mt19937 random(seed);
  std::bernoulli_distribution lit(0.2 + 0.06 * (seed % 10));
  Samples samples(kWidth * kHeight);
  for (std::uint8_t& sample : samples) sample = lit(random) ? 255 : 0;
  return samples;
}

TEST(MaskRegions, HolesAreWhatTheOutsideDoesNotReach) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    Samples samples = random_mask(seed);
    samples[0] = 0;
    Samples expected(samples.size(), 255);
    for (const size_t outside : region_at(samples, 0, false)) expected[outside] = 0;
    fill_holes({.samples = samples, .width_px = kWidth});
    EXPECT_EQ(samples, expected) << seed;
  }
}

TEST(MaskRegions, SpecksAreRegionsOfFewPixels) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    Samples samples = random_mask(seed), expected = samples;
    const size_t least = 1 + seed % 12;
    for (size_t i = 0; i < samples.size(); ++i) {
      if (samples[i] == 255 && region_at(samples, i, true).size() < least) expected[i] = 0;
    }
    drop_specks({.samples = samples, .width_px = kWidth}, static_cast<int>(least));
    EXPECT_EQ(samples, expected) << seed;
  }
}

}  // namespace
}  // namespace glasswing
