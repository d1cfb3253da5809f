// The two forms of frame files, read by our code and by libtiff, and what damage to them does.
#include "core/image/tiff.h"

#include <absl/strings/match.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "core/frame/archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr size_t kOnlyStripBytesAt = 126;  // in the header of a compressed file of one strip

Image16 noise(int width, int height, int channels, int levels) {
  Image16 image(width, height, channels);
  std::mt19937 random(static_cast<unsigned>(width * 31 + height * 7 + channels));
  for (std::uint16_t& sample : image.samples)
    sample = static_cast<std::uint16_t>(random() % static_cast<unsigned>(levels));
  return image;
}

// Smooth, bright and a little noisy, so that neighbours tell more than the samples by themselves.
Image16 slope(int width, int height, int channels) {
  Image16 image = noise(width, height, channels, 40);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c)
        image.at(x, y, c) = static_cast<std::uint16_t>(image.at(x, y, c) + 61 * x + 97 * y + 9000 * c);
    }
  }
  return image;
}

// Of all shapes and contents: one row, one column, one strip and many, the last strip full and not.
std::vector<Image16> images() {
  std::vector<Image16> images;
  for (const int channels : {1, 3}) {
    for (const auto& [width, height] :
         {std::pair{1, 1}, {1, 700}, {7, 3}, {301, 157}, {640, 48}, {5461, 5}, {16384, 2}, {2, 16384}}) {
      images.push_back(Image16(width, height, channels));
      images.push_back(noise(width, height, channels, 60));
      images.push_back(noise(width, height, channels, 65536));  // not compressible
      images.push_back(slope(width, height, channels));
    }
  }
  return images;
}

bool is_compressed(const std::string& bytes, const Image16& image) {
  return TiffRows::open(bytes, shape_of(image)).value().plain().empty();
}

int predictor_of(const std::string& compressed) {
  return compressed[10 + 11 * 12 + 8];
}

TEST(Tiff, RoundTripsInBothForms) {
  int compressed = 0;
  for (const Image16& image : images()) {
    for (const FrameForm form : {FrameForm::kPlain, FrameForm::kCompressed}) {
      const std::string bytes = encode_tiff(image, form);
      const Image16 decoded = decode_tiff(bytes).value();
      EXPECT_EQ(shape_of(decoded), shape_of(image));
      EXPECT_EQ(decoded.samples, image.samples) << image.width_px << "x" << image.height_px;
      EXPECT_LE(bytes.size(), tiff_size_bytes(shape_of(image)));
      compressed += is_compressed(bytes, image) ? 1 : 0;
      EXPECT_FALSE(form == FrameForm::kPlain && is_compressed(bytes, image));
    }
  }
  EXPECT_GE(compressed, 30);
}

TEST(Tiff, AnyRowsAreThoseOfThePicture) {
  std::mt19937 random(5);
  for (const Image16& image : images()) {
    const FrameShape shape = shape_of(image);
    for (const FrameForm form : {FrameForm::kPlain, FrameForm::kCompressed}) {
      const std::string bytes = encode_tiff(image, form);
      const TiffRows rows = TiffRows::open(bytes, shape).value();
      for (int repeat = 0; repeat < 5; ++repeat) {
        const int first = static_cast<int>(random() % static_cast<unsigned>(shape.height_px)),
                  count = 1 + static_cast<int>(random() % static_cast<unsigned>(shape.height_px - first));
        std::vector<std::uint16_t> read(shape.row_samples() * static_cast<size_t>(count));
        ASSERT_OK(rows.read(first, count, read.data()));
        const auto begin = image.samples.begin() + static_cast<std::ptrdiff_t>(shape.row_samples()) * first;
        EXPECT_TRUE(std::equal(read.begin(), read.end(), begin)) << first << " " << count;
      }
    }
  }
}

TEST(Tiff, OtherProgramsReadBothForms) {
  int differences = 0, as_they_are = 0;
  for (const Image16& image : images()) {
    for (const FrameForm form : {FrameForm::kPlain, FrameForm::kCompressed}) {
      const std::string bytes = encode_tiff(image, form);
      if (is_compressed(bytes, image)) (predictor_of(bytes) == 2 ? differences : as_they_are) += 1;
      // OpenCV reads it with libtiff.
      const cv::Mat mat =
          cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data())),
                       cv::IMREAD_UNCHANGED);
      ASSERT_EQ(mat.size(), cv::Size(image.width_px, image.height_px));
      ASSERT_EQ(mat.type(), image.channels == 3 ? CV_16UC3 : CV_16UC1);
      cv::Mat expected(mat.size(), mat.type(), const_cast<std::uint16_t*>(image.samples.data()));
      if (image.channels == 3) cv::cvtColor(expected, expected, cv::COLOR_RGB2BGR);
      EXPECT_EQ(cv::norm(mat, expected, cv::NORM_INF), 0.0);
    }
  }
  EXPECT_GT(differences, 0);
  EXPECT_GT(as_they_are, 0);
}

TEST(Tiff, CompressedIsSmallerOrPlain) {
  const Image16 dark = noise(640, 480, 1, 60);
  EXPECT_LT(encode_tiff(dark, FrameForm::kCompressed).size(), tiff_size_bytes(shape_of(dark)) / 2);
  const Image16 random = noise(640, 480, 1, 65536);
  EXPECT_EQ(encode_tiff(random, FrameForm::kCompressed), encode_tiff(random));
}

TEST(Tiff, AHeaderAloneIsNotBelieved) {
  const std::string header = encode_tiff(Image16(1, kMaxSide_px)).substr(0, kTiffPixelOffset);
  EXPECT_TRUE(absl::IsDataLoss(decode_tiff(header).status()));
  const FrameShape shape{1, kMaxSide_px};
  EXPECT_OK(check_tiff_head(header, tiff_size_bytes(shape), shape));
  EXPECT_FALSE(check_tiff_head(header, tiff_size_bytes(shape) - 1, shape).ok());
  EXPECT_FALSE(check_tiff_head(header, tiff_size_bytes(shape), {kMaxSide_px, 1}).ok());
  EXPECT_FALSE(check_tiff_head(header.substr(0, 255), tiff_size_bytes(shape), shape).ok());
  const std::string whole = encode_tiff(Image16(1, kMaxSide_px), FrameForm::kCompressed);
  const std::string head = whole.substr(0, tiff_head_bytes(shape));
  EXPECT_OK(check_tiff_head(head, whole.size(), shape));
  EXPECT_FALSE(check_tiff_head(head, whole.size() + 1, shape).ok());
  EXPECT_FALSE(check_tiff_head(head.substr(0, head.size() - 1), whole.size(), shape).ok());
  EXPECT_TRUE(absl::IsDataLoss(decode_tiff(head).status()));
}

// Also of the list of strips.
TEST(Tiff, NoByteOfTheHeadMayDiffer) {
  for (const Image16& image : {noise(4, 4, 3, 60), noise(301, 157, 1, 60)}) {
    for (const FrameForm form : {FrameForm::kPlain, FrameForm::kCompressed}) {
      const std::string good = encode_tiff(image, form);
      const size_t head = form == FrameForm::kPlain ? kTiffPixelOffset : tiff_head_bytes(shape_of(image));
      for (size_t i = 0; i < head; ++i) {
        std::string bad = good;
        bad[i] = static_cast<char>(bad[i] ^ 0x40);
        EXPECT_FALSE(decode_tiff(bad).ok()) << "byte " << i;
      }
    }
  }
}

TEST(Tiff, DamagedStripsAreNamed) {
  const Image16 image = noise(301, 157, 3, 60);
  const std::string good = encode_tiff(image, FrameForm::kCompressed);
  for (size_t size = 0; size < good.size(); size += 97)
    EXPECT_TRUE(absl::IsDataLoss(decode_tiff(good.substr(0, size)).status())) << size;
  int named = 0;
  for (size_t i = tiff_head_bytes(shape_of(image)); i < good.size(); i += 31) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x10);
    const absl::Status status = decode_tiff(bad).status();  // or another picture: the file's checksum tells
    EXPECT_TRUE(status.ok() || absl::IsDataLoss(status)) << status;
    if (absl::StartsWith(status.message(), "rows ")) ++named;
  }
  EXPECT_GT(named, 10);
}

TEST(Tiff, AStripThatHoldsMoreThanItsRowsIsRefused) {
  const std::string more = encode_tiff(Image16(64, 8), FrameForm::kCompressed);
  std::string bytes = encode_tiff(Image16(64, 4), FrameForm::kCompressed).substr(0, kTiffPixelOffset);
  bytes += more.substr(kTiffPixelOffset);
  std::memcpy(&bytes[kOnlyStripBytesAt], &more[kOnlyStripBytesAt], 4);
  EXPECT_OK(check_tiff_head(bytes, bytes.size(), {64, 4}));
  const absl::Status status = decode_tiff(bytes).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_TRUE(absl::StartsWith(status.message(), "rows 0 to 3 cannot be decompressed")) << status;
}

}  // namespace
}  // namespace glasswing
