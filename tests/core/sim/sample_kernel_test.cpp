#include "core/sim/sample_kernel.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace glasswing {
namespace {

std::vector<float> normals(std::uint64_t seed, std::int64_t stream, std::uint32_t blocks) {
  std::vector<float> all;
  std::array<float, kSampleBlock> block{};
  for (std::uint32_t i = 0; i < blocks; ++i) {
    standard_normals(seed, stream, i, block);
    all.insert(all.end(), block.begin(), block.end());
  }
  return all;
}

// The first four come from the published result of Threefry4x32-20 for zero counter and key (Random123,
// kat_vectors).
TEST(StandardNormals, AreMadeOfThePublishedRandomWords) {
  const std::vector<float> found = normals(0, 0, 1);
  constexpr std::array<std::uint32_t, 4> kWords{0x9c6ca96a, 0xe17eae66, 0xfc10ecd4, 0x5256a7d8};
  for (size_t pair = 0; pair < 2; ++pair) {
    const double radius = std::sqrt(-2.0 * std::log(kWords[2 * pair] / 0x1p32));
    const std::uint32_t turn = kWords[2 * pair + 1];
    const double angle = std::numbers::pi / 4.0 * static_cast<std::int32_t>(turn << 2) / 0x1p31;
    std::array<double, 2> point{radius * std::cos(angle), radius * std::sin(angle)};
    if (turn & 0x40000000u) std::swap(point[0], point[1]);
    if (turn & 0x80000000u) point = {-point[0], -point[1]};
    // The series for sine and cosine omit terms below 4e-7, and floats of up to 7 are rounded by 5e-7, a
    // dozen times.
    for (size_t i = 0; i < 2; ++i) EXPECT_NEAR(found[(2 * pair + i) * kSampleBlock / 4], point[i], 1e-5);
  }
}

TEST(StandardNormals, HaveTheMomentsAndTailsOfANormalDistribution) {
  const std::vector<float> x = normals(42, 7, 512);
  const auto n = static_cast<double>(x.size());
  std::array<double, 5> moments{};
  std::array<double, 5> within{};  // share inside 1 to 4 sigma
  for (const float value : x) {
    double power = 1.0;
    for (double& moment : moments) {
      moment += power / n;
      power *= value;
    }
    for (size_t k = 1; k < within.size(); ++k)
      within[k] += std::abs(value) < static_cast<float>(k) ? 1.0 / n : 0.0;
  }
  // Five standard errors: Var x^k = E x^2k - (E x^k)^2, with E x^2, x^4, x^6, x^8 = 1, 3, 15, 105.
  EXPECT_NEAR(moments[1], 0.0, 5.0 * std::sqrt(1.0 / n));
  EXPECT_NEAR(moments[2], 1.0, 5.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(moments[3], 0.0, 5.0 * std::sqrt(15.0 / n));
  EXPECT_NEAR(moments[4], 3.0, 5.0 * std::sqrt(96.0 / n));
  for (size_t k = 1; k < within.size(); ++k) {
    const double share = std::erf(static_cast<double>(k) / std::numbers::sqrt2);
    EXPECT_NEAR(within[k], share, 5.0 * std::sqrt(share * (1.0 - share) / n)) << k << " sigma";
  }
}

double correlation(const std::vector<float>& x, const std::vector<float>& y, size_t shift) {
  double sum = 0.0;
  for (size_t i = 0; i < x.size(); ++i) sum += double{x[i]} * y[(i + shift) % y.size()];
  return sum / static_cast<double>(x.size());
}

TEST(StandardNormals, AreIndependent) {
  constexpr std::uint32_t kBlocks = 64;
  const std::vector<float> x = normals(1, 1, kBlocks);
  const double bound = 5.0 / std::sqrt(static_cast<double>(x.size()));  // products have variance 1
  // Neighbours, samples of one counter, the same position in another block.
  for (const size_t shift :
       {size_t{1}, size_t{2}, size_t{3}, kSampleBlock / 4, kSampleBlock / 2, kSampleBlock}) {
    EXPECT_NEAR(correlation(x, x, shift), 0.0, bound) << shift;
  }
  // Other frames and seeds, including ones that differ in one bit.
  for (const auto& [seed, stream] : {std::pair{1, 2}, {1, -1}, {2, 1}, {3, 1}})
    EXPECT_NEAR(correlation(x, normals(static_cast<std::uint64_t>(seed), stream, kBlocks), 0), 0.0, bound);
  // Squares too: a shared radius would show only here.
  std::vector<float> squares;
  for (const float value : x) squares.push_back((value * value - 1.0f) / std::numbers::sqrt2_v<float>);
  for (const size_t shift : {size_t{1}, kSampleBlock / 4, kSampleBlock / 2, kSampleBlock})
    EXPECT_NEAR(correlation(squares, squares, shift), 0.0, bound) << shift;
}

TEST(Respond, StoresEveryCodeOnThe16BitScale) {
  std::array<float, kSampleBlock> light{}, no_deviates{};
  std::array<std::uint16_t, kSampleBlock> stored{};
  for (int bits = 8; bits <= 16; ++bits) {
    const int levels = (1 << bits) - 1;
    for (int first = 0; first <= levels; first += static_cast<int>(kSampleBlock)) {
      for (size_t i = 0; i < light.size(); ++i)
        light[i] =
            static_cast<float>(std::min(first + static_cast<int>(i), levels)) / static_cast<float>(levels);
      respond({.levels = levels}, light, no_deviates, stored);
      for (size_t i = 0; i < light.size(); ++i) {
        const int code = std::min(first + static_cast<int>(i), levels);
        ASSERT_EQ(stored[i], std::lround(code * 65535.0 / levels)) << code << " of " << levels;
      }
    }
  }
}

}  // namespace
}  // namespace glasswing
