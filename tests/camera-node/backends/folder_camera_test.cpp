// Pictures that come into a folder: half-written, damaged, doubled, of another camera, under one name, or not
// at all.
#include "camera-node/backends/folder_camera.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <fstream>
#include <random>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "tests/camera-node/backends/camera_contract.h"
#include "tests/core/image/dng.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr milliseconds kPatience(10'000);
constexpr double kExposure_ms = 5.0;
constexpr int kWidth_px = 12, kHeight_px = 8;

// A gray picture of a level, with a little that tells it from all others of the level.
Image16 picture(int level) {
  static std::uint16_t count = 0;
  Image16 image(kWidth_px, kHeight_px);
  std::ranges::fill(image.samples, static_cast<std::uint16_t>(level));
  image.samples.back() = ++count;
  return image;
}
std::string png(int level) {
  return encode_png16(picture(level)).value();
}

// At once, as by a program that renames.
void drop(const fs::path& file, std::string_view bytes) {
  const fs::path hidden = file.parent_path() / ("." + file.filename().string());
  std::ofstream(hidden, std::ios::binary) << bytes;
  fs::rename(hidden, file);
}

class FolderCameraTest : public testing::Test {
 protected:
  FolderCameraTest() { drop(folder_ / "first.png", png(1)); }
  FolderCamera::Options options() const {
    return {.name = "dslr", .directory = folder_, .exposure_ms = kExposure_ms};
  }
  std::unique_ptr<FolderCamera> started() const {
    std::unique_ptr<FolderCamera> camera = FolderCamera::open(options()).value();
    EXPECT_TRUE(camera->start(kExposure_ms).ok());
    return camera;
  }
  // Waits until a problem is told.
  static std::string problem_of(FolderCamera& camera) {
    const nanoseconds until = monotonic_now() + kPatience;
    while (monotonic_now() < until && camera.describe().due().problem().empty())
      EXPECT_FALSE(camera.next(milliseconds(50)));
    return camera.describe().due().problem();
  }
  static int level_of(const std::optional<CapturedFrame>& frame) {
    return frame ? frame->image().value().samples[0] : -1;
  }

  const TemporaryDirectory folder_;
};

TEST_F(FolderCameraTest, APictureIsExposedBetweenTheDemandAndItsFileAndHasNoTimes) {
  const auto camera = started();
  EXPECT_TRUE(camera->describe().on_demand());
  EXPECT_FALSE(camera->describe().has_due());
  const nanoseconds asked = monotonic_now();
  ASSERT_TRUE(camera->take_picture("picture 17 of 20").ok());
  EXPECT_EQ(camera->describe().due().what(), "picture 17 of 20");
  EXPECT_TRUE(camera->describe().due().by_hand());
  EXPECT_EQ(camera->describe().due().patience_ns(), 0);
  drop(folder_ / "a.png", png(1000));
  const auto frame = camera->next(kPatience);
  ASSERT_EQ(level_of(frame), 1000);
  EXPECT_TRUE(frame->taken.untimed());
  EXPECT_GE(frame->taken.exposure_start_ns(), asked.count());
  EXPECT_LE(frame->taken.exposure_end_ns(), monotonic_now().count());
  EXPECT_EQ(frame->taken.exposure_ms(), kExposure_ms);
  camera->stop();
  EXPECT_FALSE(camera->describe().has_due());
  EXPECT_TRUE(absl::IsFailedPrecondition(camera->take_picture("another")));
}

TEST_F(FolderCameraTest, AFileIsTakenOnceItIsWhole) {
  const auto camera = started();
  ASSERT_TRUE(camera->take_picture("p").ok());
  const std::string bytes = png(2000);
  std::ofstream file(folder_ / "slow.png", std::ios::binary);
  for (size_t at = 0; at < bytes.size(); at += bytes.size() / 3) {
    EXPECT_FALSE(camera->next(milliseconds(300))) << at;  // longer than a file must be quiet
    file << bytes.substr(at, bytes.size() / 3) << std::flush;
  }
  file.close();
  EXPECT_EQ(level_of(camera->next(kPatience)), 2000);
  EXPECT_FALSE(camera->next(milliseconds(300)));
}

TEST_F(FolderCameraTest, ADamagedFileIsNamedAndLeftOut) {
  const auto camera = started();
  ASSERT_TRUE(camera->take_picture("p").ok());
  drop(folder_ / "cut.png", png(1).substr(0, 60));
  EXPECT_THAT(problem_of(*camera), HasSubstr("cut.png"));
  drop(folder_ / "whole.png", png(3000));
  EXPECT_EQ(level_of(camera->next(kPatience)), 3000);
  EXPECT_EQ(camera->describe().due().problem(), "");
}

TEST_F(FolderCameraTest, ACopyIsNamedAndLeftOut) {
  const auto camera = started();
  ASSERT_TRUE(camera->take_picture("p").ok());
  const std::string bytes = png(1500);
  drop(folder_ / "a.png", bytes);
  EXPECT_EQ(level_of(camera->next(kPatience)), 1500);
  drop(folder_ / "b.png", bytes);
  EXPECT_THAT(problem_of(*camera), HasSubstr("b.png is a copy"));
}

TEST_F(FolderCameraTest, AFileThatIsWrittenAnewIsANewPicture) {
  const auto camera = started();
  for (const int level : {100, 200, 300}) {
    ASSERT_TRUE(camera->take_picture("p").ok());
    drop(folder_ / "capt0000.png", png(level));
    EXPECT_EQ(level_of(camera->next(kPatience)), level);
  }
}

TEST_F(FolderCameraTest, PicturesOfAnotherSizeAreNamedAndLeftOut) {
  const auto camera = started();
  ASSERT_TRUE(camera->take_picture("p").ok());
  drop(folder_ / "large.png", encode_png16(Image16(kWidth_px + 1, kHeight_px)).value());
  EXPECT_THAT(problem_of(*camera), HasSubstr("large.png: it is 13x8 px"));
  camera->stop();
}

TEST_F(FolderCameraTest, RawFilesGiveTheirMosaicBlackExposureAndGain) {
  constexpr int kSide_px = 32;  // LibRaw takes smaller ones for thumbnails
  Dng dng{.width_px = kSide_px, .height_px = kSide_px, .codes = {}, .bits = 14, .mosaic = "GBRG"};
  dng.codes.assign(kSide_px * kSide_px, 9000);
  dng.black = {600.0f};
  dng.white = 15000;
  dng.exposure_s = 0.125;
  dng.iso = 200;
  fs::remove(folder_ / "first.png");
  write_dng(folder_ / "first.dng", dng);
  FolderCamera::Options raw = options();
  raw.exposure_ms.reset();
  const auto camera = FolderCamera::open(raw).value();
  const v1::Camera described = camera->describe().camera();
  EXPECT_EQ(described.mosaic(), "GBRG");
  EXPECT_EQ(described.bits(), 14);
  EXPECT_DOUBLE_EQ(described.black_level(), 600.0 / 15000.0);
  ASSERT_TRUE(camera->start(125.0).ok());
  ASSERT_TRUE(camera->take_picture("p").ok());
  // A camera that measures black anew: light above it stays.
  dng.black = {610.0f};
  dng.codes[0] = 9010;
  write_dng(folder_ / "b.dng", dng);
  const auto frame = camera->next(kPatience);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->taken.gain(), 2.0);
  EXPECT_NEAR(frame->taken.exposure_ms(), 125.0, 1e-6);
  EXPECT_NEAR(frame->image()->samples[0] * 15000.0 / 65535.0, 9000.0, 0.5);
  EXPECT_NEAR(frame->image()->samples[1] * 15000.0 / 65535.0, 8990.0, 0.5);
  // Another exposure.
  dng.exposure_s = 0.25;
  dng.codes[0] = 1;
  write_dng(folder_ / "c.dng", dng);
  EXPECT_THAT(problem_of(*camera), HasSubstr("exposed for 250 ms at gain 2; the first picture was"));
}

TEST_F(FolderCameraTest, ACommandTakesEachPictureAndSaysWhyItFails) {
  const fs::path ready = folder_ / ".ready";
  std::ofstream(ready, std::ios::binary) << png(4000);
  FolderCamera::Options shooting = options();
  shooting.shoot = fmt::format("cp {} {{dir}}/shot.png", ready.string());
  const auto camera = FolderCamera::open(shooting).value();
  ASSERT_TRUE(camera->start(kExposure_ms).ok());
  std::ofstream(ready, std::ios::binary | std::ios::trunc) << png(5000);
  ASSERT_TRUE(camera->take_picture("p").ok());
  EXPECT_EQ(level_of(camera->next(kPatience)), 5000);
  EXPECT_GT(camera->describe().due().patience_ns(), 0);
  fs::remove(ready);
  ASSERT_TRUE(camera->take_picture("p").ok());
  EXPECT_THAT(problem_of(*camera), HasSubstr("cp failed with exit status 1: cp: cannot stat"));
}

TEST_F(FolderCameraTest, WhatIsWrongAtTheStartIsNamed) {
  FolderCamera::Options wrong = options();
  wrong.directory = folder_ / "none";
  EXPECT_THAT(std::string(FolderCamera::open(wrong).status().message()), HasSubstr(wrong.directory.string()));
  wrong = options();
  wrong.exposure_ms.reset();
  EXPECT_THAT(std::string(FolderCamera::open(wrong).status().message()), HasSubstr("--exposure-ms"));
  wrong = options();
  wrong.curve = "log";
  EXPECT_THAT(std::string(FolderCamera::open(wrong).status().message()), HasSubstr("--curve"));
  wrong = options();
  wrong.shoot = "no-such-program {dir}";
  wrong.patience = milliseconds(500);
  EXPECT_THAT(std::string(FolderCamera::open(wrong).status().message()),
              HasSubstr("cannot run no-such-program"));
  fs::remove(folder_ / "first.png");
  EXPECT_THAT(std::string(FolderCamera::open(options()).status().message()), HasSubstr("take one"));
}

// Pictures that come by themselves, as by a person who keeps pressing the button.
class Pressed final : public Camera {
 public:
  Pressed() {
    drop(folder_ / "first.png", png(1));
    camera_ = FolderCamera::open({.name = "dslr", .directory = folder_, .exposure_ms = kExposure_ms}).value();
    pressing_ = std::jthread([this](std::stop_token stop) {
      for (int i = 0; !stop.stop_requested(); ++i) {
        drop(folder_ / fmt::format("{}.png", i % 1000), png(i % 60'000));
        std::this_thread::sleep_for(milliseconds(20));
      }
    });
  }
  ~Pressed() override { pressing_ = {}; }
  v1::GetCameraResponse describe() const override { return camera_->describe(); }
  absl::Status start(double exposure_ms) override { return camera_->start(exposure_ms); }
  std::optional<CapturedFrame> next(milliseconds timeout) override { return camera_->next(timeout); }
  void stop() override { camera_->stop(); }

 private:
  const TemporaryDirectory folder_;
  std::unique_ptr<FolderCamera> camera_;
  std::jthread pressing_;
};

std::unique_ptr<Camera> make_folder_camera() {
  return std::make_unique<Pressed>();
}
INSTANTIATE_TEST_SUITE_P(Folder, CameraContract, testing::Values(make_folder_camera));

}  // namespace
}  // namespace glasswing
