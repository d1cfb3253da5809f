#include "core/image/radiance_hdr.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "core/image/image_file.h"

namespace glasswing {
namespace {

// By Ward's rule: code 128 of exponent 129 is 128 * 2^-7 = 1.
TEST(RadianceHdr, ReadsWhatTheFormatSays) {
  std::string bytes = "#?RADIANCE\n# a comment\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n-Y 1 +X 8\n";
  bytes += std::string("\2\2\0\10", 4);
  bytes += "\x88\x80";                                  // red: eight times 128
  bytes += std::string("\x03\x40\x20\x10\x85\x08", 6);  // green: 64, 32, 16, five times 8
  bytes += std::string("\x88\x00", 2);                  // blue
  bytes += std::string("\x88\x81", 2);                  // exponent 129
  const RadianceImage image = decode_hdr(bytes).value();
  ASSERT_EQ(image.width_px, 8);
  EXPECT_EQ(image.at(0, 0, 0), 1.0f);
  EXPECT_EQ(image.at(0, 0, 1), 0.5f);
  EXPECT_EQ(image.at(1, 0, 1), 0.25f);
  EXPECT_EQ(image.at(7, 0, 1), 0.0625f);
  EXPECT_EQ(image.at(7, 0, 2), 0.0f);
}

TEST(RadianceHdr, KeepsLightWithinHalfACode) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> octave(-20.0f, 15.0f), share(0.0f, 1.0f);
  for (const int width : {5, 8, 300}) {  // not packed; packed; longer than a run
    RadianceImage image(width, 9);
    for (int y = 0; y < image.height_px; ++y) {
      for (int x = 0; x < width; ++x) {
        const float light = y < 3 ? 3.0f : std::exp2(octave(random));
        for (int c = 0; c < 3; ++c)
          image.at(x, y, c) = y == 1 ? 0.0f : light * (c == 1 ? 1.0f : share(random));
      }
    }
    image.at(0, 0, 0) = 0.9999f;  // which rounds to 256 of its octave
    const std::string bytes = encode_hdr(image);
    ASSERT_TRUE(is_hdr(bytes));
    const RadianceImage read = decode_radiance(bytes, Encoding::kDisplay).value();
    const cv::Mat theirs = cv::imdecode(std::vector<char>(bytes.begin(), bytes.end()), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(theirs.type(), CV_32FC3);
    for (int y = 0; y < image.height_px; ++y) {
      for (int x = 0; x < width; ++x) {
        const float brightest = std::max({image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)});
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(read.at(x, y, c), image.at(x, y, c), brightest / 254.0f) << x << ' ' << y;
        for (int c = 0; c < 3; ++c) EXPECT_EQ(read.at(x, y, c), theirs.at<cv::Vec3f>(y, x)[2 - c]);
      }
    }
  }
}

TEST(RadianceHdr, RefusesDamage) {
  RadianceImage image(40, 3);
  std::ranges::fill(image.samples, 0.25f);
  const std::string bytes = encode_hdr(image);
  for (size_t length = 0; length < bytes.size(); ++length)
    EXPECT_EQ(decode_hdr(bytes.substr(0, length)).status().code(), absl::StatusCode::kDataLoss) << length;
  for (const char* height : {"-Y 16384", "-Y 4294967299"}) {  // 2^32 + 3
    std::string other = bytes;
    other.replace(other.find("-Y 3"), 4, height);
    EXPECT_EQ(decode_hdr(other).status().code(), absl::StatusCode::kDataLoss) << height;
  }
  EXPECT_THAT(std::string(decode_hdr("#?RADIANCE\n\n+Y 3 +X 40\n").status().message()),
              testing::HasSubstr("-Y HEIGHT +X WIDTH"));
}

}  // namespace
}  // namespace glasswing
