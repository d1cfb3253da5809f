#include "core/frame/archive.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <random>

#include "core/base/file.h"
#include "core/frame/image_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

Image16 noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  Image16 image(width, height);
  for (std::uint16_t& sample : image.samples) sample = static_cast<std::uint16_t>(random());
  return image;
}

class ArchiveTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(root_);
    header_.set_session("s");
    header_.mutable_camera()->set_width_px(5);
    header_.mutable_camera()->set_height_px(4);
    header_.add_monitors()->set_name("back");
  }
  void TearDown() override { fs::remove_all(root_); }

  Archive::NewFrame frame(int step) const {
    v1::Frame record;
    record.set_step(step);
    record.set_object(true);
    record.mutable_stimulus()->set_kind("solid");
    return {.record = record, .image = noise(5, 4, static_cast<unsigned>(step))};
  }

  const fs::path root_ = fs::path(testing::TempDir()) / ("archive_test." + std::to_string(::getpid()));
  const fs::path directory_ = root_ / "s";
  v1::CaptureManifest header_;
};

TEST_F(ArchiveTest, FramesComeBackAfterAnEndWithoutWarning) {
  {
    const auto archive = Archive::create(directory_, header_).value();
    ASSERT_TRUE(archive->add({frame(0), frame(1)}).ok());
  }
  // A line cut in the middle is what a crash leaves.
  std::ofstream(directory_ / "frames.jsonl", std::ios::app) << "{\"file\": \"frames/0000";
  const auto archive = Archive::open(directory_).value();
  EXPECT_EQ(archive->manifest().frames_size(), 2);
  ASSERT_TRUE(archive->add({frame(2)}).ok());
  const auto again = Archive::open(directory_).value();
  ASSERT_EQ(again->manifest().frames_size(), 3);
  for (int step = 0; step < 3; ++step) {
    const std::string rows = again->read_rows(again->manifest().frames(step).file(), 1, 2).value();
    const Image16 image = noise(5, 4, static_cast<unsigned>(step));
    EXPECT_EQ(rows, std::string(reinterpret_cast<const char*>(&image.samples[15]), 60));
  }
}

TEST_F(ArchiveTest, AStepIsStoredOnce) {
  const auto archive = Archive::create(directory_, header_).value();
  ASSERT_TRUE(archive->add({frame(3)}).ok());
  Archive::NewFrame other = frame(3);
  other.image = noise(5, 4, 99);
  const std::vector<v1::Frame> stored = archive->add({other}).value();
  EXPECT_EQ(archive->manifest().frames_size(), 1);
  EXPECT_EQ(stored[0].checksum(), archive->manifest().frames(0).checksum());
  EXPECT_EQ(decode_tiff(archive->read_frame_bytes(stored[0].file()).value()).value().samples,
            noise(5, 4, 3).samples);
}

TEST_F(ArchiveTest, DamageIsNamed) {
  std::string file;
  {
    const auto archive = Archive::create(directory_, header_).value();
    file = archive->add({frame(0)}).value()[0].file();
  }
  const std::string good = read_file(directory_ / file).value();
  std::string flipped = good;
  flipped[300] = static_cast<char>(flipped[300] ^ 1);
  for (const std::string& bytes : {flipped, good.substr(0, good.size() - 1), std::string()}) {
    ASSERT_TRUE(write_file_durably(directory_ / file, bytes).ok());
    const absl::Status status = Archive::open(directory_).value()->read_rows(file, 0, 1).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    EXPECT_NE(std::string(status.message()).find(file), std::string::npos) << status;
  }
  fs::remove(directory_ / file);
  EXPECT_TRUE(absl::IsDataLoss(Archive::open(directory_).value()->read_rows(file, 0, 1).status()));
}

TEST_F(ArchiveTest, RowsOutsideTheFrameAreRefused) {
  const auto archive = Archive::create(directory_, header_).value();
  const std::string file = archive->add({frame(0)}).value()[0].file();
  for (const auto& [first, count] :
       std::vector<std::pair<int, int>>{{-1, 1}, {0, 0}, {3, 2}, {2147483647, 1}}) {
    EXPECT_TRUE(absl::IsInvalidArgument(archive->read_rows(file, first, count).status()))
        << first << " " << count;
  }
  EXPECT_TRUE(absl::IsNotFound(archive->read_rows("frames/other.tif", 0, 1).status()));
}

TEST_F(ArchiveTest, ASealedArchiveReadsAsAnyManifest) {
  const auto archive = Archive::create(directory_, header_).value();
  ASSERT_TRUE(archive->add({frame(0), frame(1)}).ok());
  v1::CaptureManifest small = archive->manifest();
  small.mutable_monitors(0)->set_width_px(5);
  ASSERT_TRUE(archive->seal().ok());
  // A monitor without a size is refused, and the message names it.
  const absl::Status status = read_any_manifest(directory_).status();
  EXPECT_NE(std::string(status.message()).find("monitor \"back\""), std::string::npos) << status;
}

TEST_F(ArchiveTest, ForeignManifestsAreTranslated) {
  const auto written = [&](const std::string& text) {
    std::ofstream(root_ / "manifest.json") << text;
    return read_any_manifest(root_);
  };
  const std::string frames =
      R"("frames": [{"file": "a.png", "object": true, "stimulus": {"kind": "gauss_stripe", "phi_deg": -45, "r_px": -3.5,
          "sigma_px": 4, "peak": 1, "colour": [1, 1, 1], "panel": "left", "unknown": 3}}])";
  const auto manifest =
      written(R"({"monitor": {"left": {"width": 8, "height": 6}, "back": {"width": 9, "height": 7}},
      "image": {"width": 3, "height": 2}, )" +
              frames + "}")
          .value();
  EXPECT_EQ(manifest.monitors(0).name(), "left");  // the file's order
  EXPECT_EQ(manifest.monitors(1).width_px(), 9);
  EXPECT_EQ(manifest.frames(0).stimulus().r_px(), -3.5);
  EXPECT_EQ(manifest.frames(0).proof(), v1::PROOF_IMPORTED);
  for (
      const std::string& bad :
      {std::string("{"), std::string("[]"), std::string("{}"),
       R"({"monitor": {"back": {"width": 0, "height": 7}}, "image": {"width": 3, "height": 2}, )" + frames +
           "}",
       R"({"monitor": {"back": {"width": 4, "height": 7}}, "image": {"width": "3", "height": 2}, )" + frames +
           "}",
       std::string(
           R"({"monitor": {"b": {"width": 4, "height": 7}}, "image": {"width": 3, "height": 2}, "frames": []})"),
       std::string(R"({"monitor": {"b": {"width": 4, "height": 7}}, "image": {"width": 3, "height": 2},
            "frames": [{"file": "../a.png", "object": true, "stimulus": {"kind": "solid"}}]})")}) {
    const absl::Status status = written(bad).status();
    EXPECT_FALSE(status.ok()) << bad;
    EXPECT_NE(std::string(status.message()).find("manifest.json"), std::string::npos) << status;
  }
}

TEST(Tiff, RoundTripsAndReadsElsewhere) {
  const Image16 image = noise(7, 3, 1);
  const std::string bytes = encode_tiff(image);
  EXPECT_EQ(decode_tiff(bytes).value().samples, image.samples);
  // OpenCV, through libtiff, is the other reader.
  const fs::path path = fs::path(testing::TempDir()) / ("tiff_test." + std::to_string(::getpid()) + ".tif");
  ASSERT_TRUE(write_file_durably(path, bytes).ok());
  const RadianceImage read = read_radiance(path, Encoding::kLinear).value();
  ASSERT_EQ(read.samples.size(), image.samples.size());
  for (size_t i = 0; i < read.samples.size(); ++i) EXPECT_EQ(code16_of(read.samples[i]), image.samples[i]);
  fs::remove(path);
}

TEST(Tiff, NoHeaderByteMayDiffer) {
  const std::string good = encode_tiff(noise(4, 4, 2));
  for (size_t i = 0; i < kTiffPixelOffset; ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x40);
    EXPECT_FALSE(decode_tiff(bad).ok()) << "byte " << i;
  }
}

}  // namespace
}  // namespace glasswing
