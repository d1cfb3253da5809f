#include "camera-node/backends/pixel_format.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <random>
#include <set>

#include "core/image/mosaic.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using Kind = PixelFormat::Kind;
using Packing = PixelFormat::Packing;

RawPicture blank(std::string_view format, int width, int height, size_t stride, size_t bytes) {
  RawPicture picture;
  picture.format = find_pixel_format(format);
  picture.width_px = width;
  picture.height_px = height;
  picture.stride_bytes = stride;
  picture.planes.emplace_back(bytes);
  return picture;
}

// Stores the code of a raw sample at its place in the format.
void put_raw(RawPicture& picture, int x, int y, int code) {
  std::uint8_t* row = picture.planes[0].data() + static_cast<size_t>(y) * picture.stride_bytes;
  const size_t at = x;
  const auto put_bits = [&](size_t first, int value, int count) {  // the lowest first
    for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
      std::uint8_t& byte = row[(first + i) / 8];
      byte = static_cast<std::uint8_t>(byte | (value >> i & 1) << ((first + i) % 8));
    }
  };
  const int bits = picture.format->bits, low_bits = bits - 8;
  if (picture.format->packing == Packing::kCsi2) {
    const size_t group = picture.format->group_px();
    row[at / group * (group + 1) + at % group] = static_cast<std::uint8_t>(code >> low_bits);
    put_bits(8 * (at / group * (group + 1) + group) + static_cast<size_t>(low_bits) * (at % group), code,
             low_bits);
  } else if (picture.format->packing == Packing::kBits) {
    put_bits(at * static_cast<size_t>(bits), code, bits);
  } else if (picture.format->packing == Packing::kGige) {
    row[at / 2 * 3 + at % 2 * 2] = static_cast<std::uint8_t>(code >> low_bits);
    put_bits(8 * (at / 2 * 3 + 1) + 4 * (at % 2), code, low_bits);
  } else if (picture.format->bits == 8) {
    row[at] = static_cast<std::uint8_t>(code);
  } else {
    row[2 * at] = static_cast<std::uint8_t>(code & 255);
    row[2 * at + 1] = static_cast<std::uint8_t>(code >> 8);
  }
}

std::vector<const PixelFormat*> formats_of(Kind kind) {
  std::vector<const PixelFormat*> found;
  for (const PixelFormat& format : pixel_formats()) {
    if (format.kind == kind) found.push_back(&format);
  }
  return found;
}

TEST(PixelFormat, NamesAreFoundAndUnique) {
  std::set<std::string_view> names;
  for (const PixelFormat& format : pixel_formats()) {
    EXPECT_TRUE(names.insert(format.name).second) << format.name;
    EXPECT_EQ(find_pixel_format(format.name), &format);
  }
  EXPECT_EQ(find_pixel_format("SRGGB11"), nullptr);
}

// Each photosite keeps its own code, and nothing else.
TEST(PixelFormat, AMosaicStaysAsTheSensorGaveIt) {
  constexpr int kWidth = 16, kHeight = 12;
  std::mt19937 random(1);
  for (const PixelFormat* format : formats_of(Kind::kBayer)) {
    SCOPED_TRACE(format->name);
    EXPECT_OK(Mosaic::parse(format->order));
    const int full = (1 << format->bits) - 1;
    RawPicture picture = blank(format->name, kWidth, kHeight, 64, 64 * kHeight);
    std::vector<int> codes;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        codes.push_back(static_cast<int>(random() % static_cast<unsigned>(full + 1)));
        put_raw(picture, x, y, codes.back());
      }
    }
    const Image16 image = image_of(picture).value();
    EXPECT_EQ(image.channels, 1);
    ASSERT_EQ(image.samples.size(), codes.size());
    for (size_t i = 0; i < codes.size(); ++i)
      EXPECT_NEAR(image.samples[i], codes[i] * 65535.0 / full, 0.51) << i;  // rounding, and float precision
  }
}

TEST(PixelFormat, GrayKeepsEveryBitAndLosesTheBlackLevel) {
  for (const PixelFormat* format : formats_of(Kind::kGray)) {
    SCOPED_TRACE(format->name);
    const int full = (1 << format->bits) - 1, width = 4;
    for (int code = 0; code <= full; ++code) {
      RawPicture picture = blank(format->name, width, 1, 8, 8);
      for (int x = 0; x < width; ++x) put_raw(picture, x, 0, (code + 37 * x) % (full + 1));
      for (const double black : {0.0, 0.0625}) {
        picture.black = black;
        const Image16 image = image_of(picture).value();
        for (int x = 0; x < width; ++x) {
          const double light =
              ((code + 37 * x) % (full + 1) / static_cast<double>(full) - black) / (1.0 - black);
          for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(image.at(x, 0, c), std::max(light, 0.0) * 65535.0,
                        0.51);  // rounding, and float precision
        }
      }
    }
  }
}

// Light to code, by IEC 61966-2-1 and ITU-R BT.709.
double encoded(ColourCode::Transfer transfer, double light) {
  if (transfer == ColourCode::Transfer::kLinear) return light;
  if (transfer == ColourCode::Transfer::kSrgb)
    return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
  return light < 0.018 ? 4.5 * light : 1.099 * std::pow(light, 0.45) - 0.099;
}

constexpr ColourCode::Transfer kTransfers[] = {ColourCode::Transfer::kLinear, ColourCode::Transfer::kSrgb,
                                               ColourCode::Transfer::kRec709};

TEST(PixelFormat, RgbCodesStandForTheirLight) {
  for (const PixelFormat* format : formats_of(Kind::kRgb)) {
    for (const ColourCode::Transfer transfer : kTransfers) {
      const size_t pixel = format->order.size();
      RawPicture picture = blank(format->name, 256, 1, 256 * pixel, 256 * pixel);
      picture.colour.transfer = transfer;
      for (size_t x = 0; x < 256; ++x) {
        for (size_t c = 0; c < 3; ++c)
          picture.planes[0][x * pixel + format->order.find("RGB"[c])] =
              static_cast<std::uint8_t>(x ^ (85 * c));
      }
      const Image16 image = image_of(picture).value();
      for (int x = 0; x < 256; ++x) {
        for (int c = 0; c < 3; ++c) {
          // Light is rounded to 1/65535, and the curves' slope is at most 12.92. The standards' own pieces
          // meet within 1e-4 only.
          EXPECT_NEAR(encoded(transfer, image.at(x, 0, c) / 65535.0) * 255.0, x ^ (85 * c), 0.03);
        }
      }
    }
  }
}

TEST(PixelFormat, YcbcrIsTheColourItWasMadeOf) {
  struct Standard {
    double kr, kb;
  };
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(0.0, 1.0);
  for (const Standard standard : {Standard{0.299, 0.114}, Standard{0.2126, 0.0722}}) {
    for (const bool full : {false, true}) {
      for (const std::string_view name : {"YUYV", "UYVY", "NV12"}) {
        for (int repeat = 0; repeat < 200; ++repeat) {
          // Two by two pixels of one colour.
          const double rgb[3] = {any(random), any(random), any(random)};
          const double luma =
              standard.kr * rgb[0] + (1 - standard.kr - standard.kb) * rgb[1] + standard.kb * rgb[2];
          const double cb = (rgb[2] - luma) / (2 * (1 - standard.kb)),
                       cr = (rgb[0] - luma) / (2 * (1 - standard.kr));
          const auto code = [](double value) { return static_cast<std::uint8_t>(std::lround(value)); };
          const std::uint8_t y8 = code(full ? 255 * luma : 16 + 219 * luma);
          const std::uint8_t u8 = code(128 + (full ? 255 : 224) * cb),
                             v8 = code(128 + (full ? 255 : 224) * cr);
          RawPicture picture = blank(name, 2, 2, 4, 8);
          picture.colour = {.transfer = ColourCode::Transfer::kLinear,
                            .kr = standard.kr,
                            .kb = standard.kb,
                            .full_range = full};
          if (name == "YUYV") picture.planes[0] = {y8, u8, y8, v8, y8, u8, y8, v8};
          if (name == "UYVY") picture.planes[0] = {u8, y8, v8, y8, u8, y8, v8, y8};
          if (name == "NV12") picture.planes = {{y8, y8, 0, 0, y8, y8, 0, 0}, {u8, v8, 0, 0}};
          const Image16 image = image_of(picture).value();
          // Each code is rounded by at most half; a colour takes 2 (1 - k) < 1.86 of Cb or Cr, and green less
          // than 0.35 + 0.72.
          const double steps = 0.5 / 219.0 + 0.5 * 1.86 / 224.0;
          for (size_t i = 0; i < image.samples.size(); ++i)
            EXPECT_NEAR(image.samples[i] / 65535.0, rgb[i % 3], steps + 1.0 / 65535.0) << name;
        }
      }
    }
  }
}

TEST(PixelFormat, JpegIsRead) {
  // JPEG changes gray by about one code: at quality 100 the quantization step is 1.
  cv::Mat gray(16, 24, CV_8UC3, cv::Scalar(128, 128, 128));
  RawPicture picture = blank("MJPEG", 24, 16, 0, 0);
  ASSERT_TRUE(cv::imencode(".jpg", gray, picture.planes[0], {cv::IMWRITE_JPEG_QUALITY, 100}));
  picture.colour.transfer = ColourCode::Transfer::kLinear;
  const auto image = image_of(picture);
  for (const std::uint16_t sample : image->samples) EXPECT_NEAR(sample, 128 * 257, 257);
  picture.width_px = 32;
  EXPECT_TRUE(absl::IsDataLoss(image_of(picture).status()));
  // Other formats and damaged files are refused.
  const std::vector<std::uint8_t> jpeg = std::exchange(picture.planes[0], {});
  picture.width_px = 24;
  ASSERT_TRUE(cv::imencode(".png", gray, picture.planes[0]));
  EXPECT_TRUE(absl::IsDataLoss(image_of(picture).status()));
  picture.planes[0] = jpeg;
  EXPECT_OK(image_of(picture));
  picture.planes[0].resize(40);
  EXPECT_TRUE(absl::IsDataLoss(image_of(picture).status()));
  picture.planes[0].clear();
  EXPECT_TRUE(absl::IsDataLoss(image_of(picture).status()));
}

TEST(PixelFormat, AFrameThatIsTooShortIsDataLoss) {
  for (const PixelFormat& format : pixel_formats()) {
    if (format.kind == Kind::kJpeg) continue;
    RawPicture picture = blank(format.name, 8, 4, 32, 32 * 4);
    if (format.kind == Kind::kNv12) picture.planes.emplace_back(32 * 2);
    EXPECT_OK(image_of(picture)) << format.name;
    picture.planes.back().resize(32);
    EXPECT_TRUE(absl::IsDataLoss(image_of(picture).status())) << format.name;
    picture.planes.clear();
    EXPECT_TRUE(absl::IsDataLoss(image_of(picture).status())) << format.name;
  }
}

}  // namespace
}  // namespace glasswing
