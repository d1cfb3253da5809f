// Converts codes to light with known curves, crosstalk and drift.
#include "solver/method/linear_stack.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "solver/method/frame_correction.h"
#include "tests/solver/stack_of.h"

namespace glasswing {
namespace {

constexpr double kBlack = 0.05;

// code = black + (1 - black) light^(1/2) above 0; linear, as steep as at light 0.0001, below.
double code_of(double light) {
  const double toe = 1e-4;
  return kBlack + (0.9 - kBlack) * (light > toe ? std::sqrt(light) : light / std::sqrt(toe));
}

v1::CameraCalibration calibration() {
  v1::CameraCalibration calibration;
  calibration.set_format_version(1);
  calibration.set_camera("cam");
  calibration.set_saturation(0.9);
  calibration.set_read_sd(0.002);
  calibration.set_shot_gain(1e-4);
  for (int c = 0; c < 3; ++c) {
    v1::CameraCurve& curve = *calibration.add_curves();
    for (int k = 0; k <= 8192; ++k) {
      const double above = (k / 8192.0 - kBlack) / (0.9 - kBlack);
      curve.add_light(static_cast<float>(above > 0.01 ? above * above : 0.01 * above));
    }
  }
  return calibration;
}

v1::CaptureManifest manifest_of(int width, int height, int frames) {
  v1::CaptureManifest manifest;
  manifest.mutable_camera()->set_width_px(width);
  manifest.mutable_camera()->set_height_px(height);
  for (int i = 0; i < frames; ++i) {
    v1::Frame& frame = *manifest.add_frames();
    frame.set_file(std::to_string(i) + ".tif");
    frame.mutable_stimulus()->set_kind("solid");
    for (int c = 0; c < 3; ++c) frame.mutable_stimulus()->add_colour(i == 0 ? 0.0 : 1.0);
  }
  return manifest;
}

Image16 even_frame(int width, int height, std::array<double, 3> codes) {
  Image16 image(width, height);
  for (size_t i = 0; i < image.samples.size(); ++i)
    image.samples[i] = static_cast<std::uint16_t>(std::lround(65535.0 * codes[i % 3]));
  return image;
}

TEST(LinearStack, WithoutCalibrationNothingIsCopied) {
  const v1::CaptureManifest manifest = manifest_of(4, 2, 1);
  const std::vector<Image16> frames = {even_frame(4, 2, {0.1, 0.2, 1.0})};
  const FrameStack stack = LinearStack::create(manifest).value().of(stack_of(manifest, frames));
  EXPECT_EQ(stack.rows[0].data(), frames[0].samples.data());
  EXPECT_EQ(stack.zero, 0.0f);
  EXPECT_FLOAT_EQ(stack.at(0, 3, 1, 1), 13107.0f / 65535.0f);
}

TEST(LinearStack, CodesComeBackAsLight) {
  v1::CaptureManifest manifest = manifest_of(4, 2, 5);
  *manifest.mutable_camera_calibration() = calibration();
  const std::vector<double> lights = {-0.0004, 0.0, 0.01, 0.3, 0.99};
  std::vector<Image16> frames;
  for (const double light : lights) {
    const double code = code_of(light);
    frames.push_back(even_frame(4, 2, {code, code, 0.93}));
  }
  const LinearStack linear = LinearStack::create(manifest).value();
  const FrameStack stack = linear.of(stack_of(manifest, frames));
  for (size_t i = 0; i < lights.size(); ++i) {
    const int frame = static_cast<int>(i);
    // Half a step of the camera's 16 bits and of the stack's, and the curve's bend between two knots: at most
    // (1 / 8192 / 0.85)^2 / 4.
    const double step = 2.0 * std::sqrt(std::max(lights[i], 1e-4)) / 0.85 / 65535.0;
    EXPECT_NEAR(static_cast<double>(stack.at(frame, 2, 1, 0)), lights[i],
                0.5 * (step + static_cast<double>(stack.unit)) + 1e-8);
    EXPECT_LT(stack.rows[i][0], kSaturatedCode);
    EXPECT_GE(stack.rows[i][2], kSaturatedCode);  // saturation does not spread to other channels
  }
  const v1::CaptureManifest of_light = linear.manifest_of_light(manifest);
  EXPECT_EQ(of_light.camera().read_sd(), 0.002);
  EXPECT_EQ(of_light.camera().gain(), 1e-4);
}

TEST(LinearStack, NoiseAroundBlackKeepsItsMean) {
  constexpr int kWidth = 400, kHeight = 50;
  v1::CaptureManifest manifest = manifest_of(kWidth, kHeight, 1);
  *manifest.mutable_camera_calibration() = calibration();
  std::vector<Image16> frames = {Image16(kWidth, kHeight)};
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0.0, 1e-4);
  for (std::uint16_t& sample : frames[0].samples)
    sample = static_cast<std::uint16_t>(std::lround(65535.0 * code_of(std::min(noise(random), 1e-4))));
  const FrameStack stack = LinearStack::create(manifest).value().of(stack_of(manifest, frames));
  std::mt19937 again(4);
  noise.reset();
  double got = 0.0, true_light = 0.0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        got += static_cast<double>(stack.at(0, x, y, c));
        true_light += std::min(noise(again), 1e-4);
      }
    }
  }
  // Two roundings of a step each: s / sqrt(12) a sample, four standard errors of the mean.
  const double count = 3.0 * kWidth * kHeight;
  EXPECT_NEAR(got / count, true_light / count,
              4.0 * static_cast<double>(stack.unit) * std::sqrt(2.0 / 12.0 / count));
}

constexpr double kCrosstalk[3][3] = {{0.45, 0.04, 0.01}, {0.10, 0.80, 0.10}, {0.00, 0.09, 0.51}};

void add_display(v1::CaptureManifest& manifest, const std::string& monitor, double more_green = 0.0) {
  v1::DisplayCalibration& display = *manifest.add_display_calibrations();
  display.set_monitor(monitor);
  manifest.add_monitors()->set_name(monitor);
  for (int c = 0; c < 3; ++c) {
    for (int p = 0; p < 3; ++p) display.add_crosstalk(kCrosstalk[c][p] + (p == 1 ? more_green : 0.0));
  }
}

TEST(LinearStack, GraysTellWhatSaturatedWhiteShouldBe) {
  const v1::CaptureManifest manifest = manifest_of(2, 1, 4);
  std::vector<Image16> frames = {even_frame(2, 1, {0.02, 0.02, 0.02}), even_frame(2, 1, {0.4, 0.6, 0.2}),
                                 even_frame(2, 1, {0.78, 1.0, 0.38}), even_frame(2, 1, {1.0, 1.0, 0.5})};
  const auto corrections = std::make_shared<FrameCorrections>();
  corrections->of_frame.resize(4);
  corrections->of_frame[2].grays = {.gray = 1, .black = 0, .level = 0.5f};
  FrameStack stack = stack_of(manifest, frames);
  stack.corrections = corrections;
  stack = LinearStack::create(manifest).value().of(stack);
  constexpr double kCode = 1.6 / 65535.0;  // of light to 1.5, and noise below 0
  EXPECT_NEAR(stack.at(2, 0, 0, 0), 0.78, kCode);
  EXPECT_NEAR(stack.at(2, 0, 0, 1), 0.02 + (0.6 - 0.02) / 0.5, kCode);
  EXPECT_NEAR(stack.at(2, 0, 0, 2), 0.38, kCode);
  EXPECT_LT(stack.rows[2][1], kSaturatedCode);
  // What no gray tells keeps the light of full scale, and is known to be saturated.
  EXPECT_EQ(stack.at(3, 0, 0, 0), 1.0f);
  EXPECT_GE(stack.rows[3][0], kSaturatedCode);
}

TEST(LinearStack, ChannelsStayTheCamerasAndTheMatteSaysWhatTheySee) {
  v1::CaptureManifest manifest = manifest_of(2, 2, 1);
  add_display(manifest, "back");
  const auto linear = LinearStack::create(manifest).value();
  const std::vector<Image16> frames{even_frame(2, 2, {0.2, 0.4, 0.6})};  // the stack lends its rows
  const FrameStack stack = linear.of(stack_of(manifest, frames));
  EXPECT_NEAR(static_cast<double>(stack.at(0, 1, 1, 2)), 0.6, 1.0 / 65535.0);
  v1::MatteMetadata metadata;
  linear.describe(metadata);
  ASSERT_EQ(metadata.crosstalk_size(), manifest.monitors_size());
  EXPECT_EQ(metadata.crosstalk(0).share_size(), 9);
  EXPECT_FALSE(metadata.linearised());
  EXPECT_EQ(metadata.warnings_size(), 0);
}

TEST(LinearStack, SaysWhatMayBeWrongAndRefusesWhatCannotBe) {
  v1::CaptureManifest manifest = manifest_of(2, 2, 1);
  const auto warnings = [&] {
    v1::MatteMetadata metadata;
    LinearStack::create(manifest).value().describe(metadata);
    return metadata.warnings();
  };
  EXPECT_TRUE(warnings().empty());
  manifest.mutable_camera()->set_response("unknown");
  manifest.mutable_camera()->set_name("cam");
  ASSERT_EQ(warnings().size(), 1);
  EXPECT_NE(warnings()[0].find("\"cam\" was not calibrated"), std::string::npos);
  *manifest.mutable_camera_calibration() = calibration();
  EXPECT_TRUE(warnings().empty());
  manifest.mutable_camera_calibration()->set_gain(1.0);
  manifest.mutable_frames(0)->set_gain(4.0);
  ASSERT_EQ(warnings().size(), 1);
  EXPECT_NE(warnings()[0].find("gain of 4"), std::string::npos);
  manifest.mutable_frames(0)->set_gain(1.0);
  add_display(manifest, "back");
  EXPECT_TRUE(warnings().empty());
  add_display(manifest, "left", 0.1);
  ASSERT_EQ(warnings().size(), 1);
  EXPECT_NE(warnings()[0].find("primaries differ"), std::string::npos);
  const auto refused = [&](const std::string& words) {
    const absl::Status status = LinearStack::create(manifest).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  manifest.mutable_display_calibrations(1)->mutable_crosstalk()->RemoveLast();
  refused("8 long");
  manifest.mutable_camera_calibration()->mutable_curves()->RemoveLast();
  refused("2 long");
}

}  // namespace
}  // namespace glasswing
