#include "core/image/mosaic.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "core/file/file.h"
#include "core/frame/archive.h"
#include "core/image/image_file.h"
#include "core/import/foreign_manifest.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// Rises linearly along x and y, differently in each channel.
Image16 plane(int width, int height) {
  Image16 image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c)
        image.at(x, y, c) = static_cast<std::uint16_t>(1000 * (c + 1) + 40 * (c + 1) * x + 60 * (3 - c) * y);
    }
  }
  return image;
}

class MosaicFiles : public testing::Test {
 protected:
  const TemporaryDirectory directory_;
};

TEST(Mosaic, NamesTheColoursOfTwoRowsOfTwoSites) {
  const std::string_view order = "RGB";
  for (const std::string_view name : {"RGGB", "GRBG", "GBRG", "BGGR"}) {
    const Mosaic mosaic = Mosaic::parse(name).value();
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 4; ++x) EXPECT_EQ(order[mosaic.channel(x, y)], name[y % 2 * 2 + x % 2]);
    }
  }
  for (const std::string_view name : {"", "RGBG", "rggb", "RGGBX", "RGB"})
    EXPECT_TRUE(absl::IsInvalidArgument(Mosaic::parse(name).status())) << name;
}

TEST(Mosaic, InterpolationKeepsWhatWasMeasuredAndPlanes) {
  const Image16 truth = plane(9, 8);
  for (const std::string_view name : {"RGGB", "GRBG", "GBRG", "BGGR"}) {
    const Mosaic mosaic = Mosaic::parse(name).value();
    const Image16 frame = sampled(truth, mosaic);
    ASSERT_EQ(frame.samples.size(), truth.samples.size() / 3);
    const Image16 image = interpolated(frame, mosaic);
    for (int y = 0; y < truth.height_px; ++y) {
      for (int x = 0; x < truth.width_px; ++x) {
        const int own = mosaic.channel(x, y);
        EXPECT_EQ(image.at(x, y, own), truth.at(x, y, own));
        const bool rim = x == 0 || y == 0 || x + 1 == truth.width_px || y + 1 == truth.height_px;
        for (int c = 0; c < 3 && !rim; ++c) EXPECT_EQ(image.at(x, y, c), truth.at(x, y, c)) << x << "," << y;
      }
    }
  }
  EXPECT_EQ(interpolated(truth, std::nullopt).samples, truth.samples);
}

TEST_F(MosaicFiles, FramesOfOneChannelAreATiffThatOthersRead) {
  const Image16 frame = sampled(plane(7, 5), Mosaic::parse("RGGB").value());
  const std::string bytes = encode_tiff(frame);
  EXPECT_EQ(bytes.size(), kTiffPixelOffset + 7 * 5 * 2);
  const Image16 read = decode_tiff(bytes).value();
  EXPECT_EQ(read.samples, frame.samples);
  EXPECT_EQ(read.channels, 1);
  EXPECT_OK(check_tiff_head(bytes, bytes.size(), shape_of(frame)));
  EXPECT_FALSE(check_tiff_head(bytes, bytes.size(), {.width_px = 7, .height_px = 5, .channels = 3}).ok());
  for (size_t i = 0; i < kTiffPixelOffset; ++i) {
    std::string bad = bytes;
    bad[i] = static_cast<char>(bad[i] ^ 0x40);
    EXPECT_FALSE(decode_tiff(bad).ok()) << "byte " << i;
  }
  const fs::path path = directory_ / "frame.tif";
  ASSERT_OK(write_file_durably(path, bytes));
  const cv::Mat by_libtiff = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(by_libtiff.type(), CV_16UC1);
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) EXPECT_EQ(by_libtiff.at<std::uint16_t>(y, x), frame.at(x, y, 0));
  }
}

TEST_F(MosaicFiles, AMosaicsFrameHasOneChannel) {
  const Image16 truth = plane(6, 4);
  const Image16 frame = sampled(truth, Mosaic::parse("BGGR").value());
  const FrameShape shape = shape_of(frame);
  const cv::Mat gray(4, 6, CV_16UC1, const_cast<std::uint16_t*>(frame.samples.data()));
  ASSERT_TRUE(cv::imwrite((directory_ / "gray.png").string(), gray));
  ASSERT_OK(write_file_durably(directory_ / "rgb.png", encode_png16(truth).value()));
  ASSERT_OK(write_file_durably(directory_ / "rgb.tif", encode_tiff(truth)));
  EXPECT_EQ(read_frame_file(directory_ / "gray.png", shape).value().samples, frame.samples);
  for (const char* name : {"rgb.png", "rgb.tif"}) {
    const absl::Status status = read_frame_file(directory_ / name, shape).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << name;
    EXPECT_NE(std::string(status.message()).find("mosaic"), std::string::npos) << status;
  }
  // Without a mosaic, gray is r = g = b as ever.
  EXPECT_EQ(read_frame_file(directory_ / "gray.png").value().channels, 3);
  EXPECT_FALSE(read_frame_file(directory_ / "gray.png", FrameShape{6, 5, 1}).ok());
}

TEST_F(MosaicFiles, AnArchiveTakesFramesOfItsShapeOnly) {
  v1::CaptureManifest header;
  header.set_session("s");
  header.mutable_camera()->set_width_px(6);
  header.mutable_camera()->set_height_px(4);
  header.mutable_camera()->set_mosaic("RGGB");
  const auto archive = Archive::create(directory_ / "s", header).value();
  EXPECT_EQ(archive->row_bytes(), 12u);
  const Image16 truth = plane(6, 4);
  v1::Frame record;
  record.mutable_stimulus()->set_kind("solid");
  EXPECT_TRUE(absl::IsInvalidArgument(archive->add({{.record = record, .image = truth}}).status()));
  const Image16 frame = sampled(truth, *mosaic_of(header.camera()));
  const v1::Frame stored = archive->add({{.record = record, .image = frame}}).value().front();
  EXPECT_EQ(decode_tiff(archive->read_frame_bytes(stored.file()).value()).value().samples, frame.samples);
  header.mutable_camera()->set_mosaic("RGBG");
  EXPECT_TRUE(absl::IsInvalidArgument(Archive::create(directory_ / "t", header).status()));
}

TEST_F(MosaicFiles, ForeignManifestsTellOfTheSensor) {
  const auto read = [&](const std::string& more) {
    std::ofstream(directory_ / "manifest.json")
        << R"({"monitor": {"back": {"width": 8, "height": 6}}, "image": {"width": 6, "height": 4}, )" << more
        << R"("frames": [{"file": "a.png", "object": true, "stimulus": {"kind": "solid", "panel": "back"}}]})";
    return read_any_manifest(directory_);
  };
  const v1::Camera raw =
      read(
          R"("cfa": "RGGB", "sensor": {"bits": 12, "black_level": 256, "full_well_e": 20000, "read_noise_sd": 0.003},)")
          .value()
          .camera();
  EXPECT_EQ(raw.mosaic(), "RGGB");
  EXPECT_EQ(raw.bits(), 12);
  EXPECT_DOUBLE_EQ(raw.black_level(), 256.0 / 4095.0);
  EXPECT_DOUBLE_EQ(raw.gain(), 1.0 / 20000.0);
  EXPECT_DOUBLE_EQ(raw.read_sd(), 0.003);
  EXPECT_EQ(shape_of(raw), (FrameShape{6, 4, 1}));
  const v1::Camera plain = read("").value().camera();
  EXPECT_EQ(plain.mosaic(), "");
  EXPECT_EQ(plain.bits(), 16);
  EXPECT_EQ(shape_of(plain), (FrameShape{6, 4, 3}));
  for (const char* bad : {R"("cfa": "RGBG",)", R"("cfa": 3,)", R"("sensor": {"bits": 17},)",
                          R"("sensor": {"black_level": -1},)", R"("sensor": {"black_level": "256"},)",
                          R"("sensor": {"bits": 8, "black_level": 255},)"}) {
    const absl::Status status = read(bad).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << bad << status;
    EXPECT_NE(std::string(status.message()).find("manifest.json"), std::string::npos) << status;
  }
}

}  // namespace
}  // namespace glasswing
