#include "core/web/web_matte.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <map>
#include <numbers>

#include "core/footprint/fill.h"
#include "core/rays/cube.h"
#include "tests/core/web/made_for_web.h"

namespace glasswing {
namespace {

std::map<std::string, std::string> planes_of(const WebMatte& web) {
  std::map<std::string, std::string> planes;
  size_t at = 0;
  for (const WebPlane& plane : web.planes) {
    std::string bytes(5000, '\0');
    uLongf size = bytes.size();
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(bytes.data()), &size,
                         reinterpret_cast<const Bytef*>(web.bytes.data() + at), plane.bytes),
              Z_OK)
        << plane.name;
    at += plane.bytes;
    bytes.resize(size);
    planes[plane.name] = bytes;
  }
  EXPECT_EQ(at, web.bytes.size());
  return planes;
}

// The sum of differences, as docs/web.md folds them.
std::vector<int> numbers_of(const std::string& low, const std::string& high) {
  std::vector<int> numbers;
  int value = 0;
  for (size_t i = 0; i < low.size(); ++i) {
    const int folded = static_cast<unsigned char>(low[i]) | static_cast<unsigned char>(high[i]) << 8;
    value += folded % 2 == 0 ? folded / 2 : -(folded + 1) / 2;
    numbers.push_back(value & 0xffff);
  }
  return numbers;
}

// The sum of a channel's weights by pixel.
std::vector<int> light_of_pixels(const std::map<std::string, std::string>& planes,
                                 const std::string& channel) {
  const std::string &low = planes.at(channel + "_low"), &high = planes.at(channel + "_high");
  std::vector<int> sums, last(255);
  size_t i = 0;
  for (const char count : planes.at("count")) {
    int sum = 0;
    for (size_t slot = 0; slot < static_cast<unsigned char>(count); ++slot, ++i)
      sum += last[slot] = (last[slot] + numbers_of(low.substr(i, 1), high.substr(i, 1)).front()) & 0xffff;
    sums.push_back(sum);
  }
  return sums;
}

TEST(WebMatte, HolesAreFilledAsByMatteFill) {
  Matte filled = a_matte();
  EXPECT_GE(fill(filled), 1);
  const WebMatte holed = encode_web_matte(a_matte()).value();
  const auto planes = planes_of(holed), expected = planes_of(encode_web_matte(filled).value());
  for (const auto& [name, bytes] : planes)  // the filled matte has a row more, which sees no monitor
    EXPECT_EQ(bytes.substr(0, 2 * kWidth), expected.at(name).substr(0, 2 * kWidth)) << name;
}

TEST(WebMatte, HoldsWhatTheMatteHas) {
  const WebMatte web = encode_web_matte(a_matte()).value();
  EXPECT_EQ(web.region, (MatteRegion{0, 0, kWidth, kHeight - 1}));
  const auto planes = planes_of(web);
  // Two footprints in the first column, elsewhere one that the channels share; (1, 1) is filled.
  std::string counts;
  for (int y = 0; y < kHeight - 1; ++y) counts += "\2\1\1\1\1";
  counts[kWidth + 1] = planes.at("count")[kWidth + 1];
  EXPECT_EQ(planes.at("count"), counts);
  EXPECT_GT(counts[kWidth + 1], 0);
  ASSERT_EQ(web.unit_px, 0.0625);
  const double first_x = (100.0 - web.origin_px) / web.unit_px,
               first_y = (200.0 - web.origin_px) / web.unit_px;
  EXPECT_EQ(numbers_of(planes.at("x_low"), planes.at("x_high")).front(), first_x);
  EXPECT_EQ(numbers_of(planes.at("y_low"), planes.at("y_high")).front(), first_y);
  // sigma 2 px is 5 octaves above 1/16, sigma 1 four.
  EXPECT_EQ(planes.at("wide").front(), static_cast<char>(5 * 16));
  EXPECT_EQ(planes.at("narrow").front(), static_cast<char>(4 * 16));
  EXPECT_EQ(planes.at("angle").front(), 0);
  EXPECT_EQ(numbers_of(planes.at("red_low"), planes.at("red_high")).front(), 128);
  EXPECT_EQ(numbers_of(planes.at("green_low"), planes.at("green_high")).front(), 256);
  EXPECT_EQ(numbers_of(planes.at("blue_low"), planes.at("blue_high")).front(), 384);
}

// A pyramid's many coefficients become fewer footprints that have all of its light, to half a unit of weight
// each.
TEST(WebMatte, HoldsPyramids) {
  Matte matte = a_matte();
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  PyramidFootprint ring{.foreground = 0.2f, .coefficients = {}};
  constexpr int kCoefficients = 120;
  for (int i = 0; i < kCoefficients; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kCoefficients;
    ring.coefficients.push_back({.column = static_cast<int>(50 + 6 * std::cos(angle)),
                                 .row = static_cast<int>(100 + 6 * std::sin(angle)),
                                 .weight = 0.5f / kCoefficients});
  }
  matte.add_pyramid(2, 2, 0, ring);
  const WebMatte web = encode_web_matte(matte).value(), before = encode_web_matte(a_matte()).value();
  const auto added = static_cast<double>(web.footprint_count - before.footprint_count);
  EXPECT_GT(added, 8);
  EXPECT_LT(added, kCoefficients / 2.0);
  const auto planes = planes_of(web), plain = planes_of(before);
  const size_t pixel = 2 * kWidth + 2;
  const auto red = light_of_pixels(planes, "red");
  EXPECT_NEAR(red[pixel] * kWeightUnit, 0.5, 0.5 * kWeightUnit * added);
  EXPECT_EQ(red[pixel + 1], light_of_pixels(plain, "red")[pixel + 1]);
  EXPECT_NE(planes.at("red"), plain.at("red"));  // F
}

TEST(WebMatte, AnglesAreThoseOfTheWideAxis) {
  Matte matte = a_matte();
  for (int c = 0; c < kChannels; ++c) {  // 4 along 30 degrees, 1 across
    Mode& mode = matte.modes(0, 0, c)[0];
    mode.xx_px2 = 3.25f;
    mode.yy_px2 = 1.75f;
    mode.xy_px2 = static_cast<float>(3.0 * std::sqrt(3.0) / 4.0);
  }
  const auto planes = planes_of(encode_web_matte(matte).value());
  // A turn of 0.2 narrow / wide = 0.1 rad is 8.1 of 256: angles are multiples of 8.
  EXPECT_EQ(planes.at("angle").front(), 40);  // 30 degrees are 42.7
  EXPECT_EQ(planes.at("wide").front(), static_cast<char>(5 * 16));
}

// On the face ahead, whose pixel is 2 / 3600 at distance 1: the middle, and widths of 18 and 9 px.
TEST(WebMatte, OfDirectionsIsInPixelsOfACube) {
  const Matte matte = matte_of_directions(two_rays(), {.half_side = 1.0, .side_px = 3600}, 1);
  const WebMatte web = encode_web_matte(matte).value();
  const auto planes = planes_of(web);
  ASSERT_EQ(web.unit_px, 0.0625);
  EXPECT_NEAR(web.origin_px + web.unit_px * numbers_of(planes.at("x_low"), planes.at("x_high")).front(),
              1800.0, 0.6);
  EXPECT_EQ(planes.at("texture").front(), 4);
  EXPECT_NEAR(static_cast<unsigned char>(planes.at("wide").front()), 16.0 * std::log2(18.0 * 16.0), 0.51);
  EXPECT_NEAR(static_cast<unsigned char>(planes.at("narrow").front()), 16.0 * std::log2(9.0 * 16.0), 0.51);
}

}  // namespace
}  // namespace glasswing
