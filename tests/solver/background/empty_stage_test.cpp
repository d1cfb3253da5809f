// The background map in simulated rigs of known geometry.
#include "solver/background/empty_stage.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/composite/compositor.h"
#include "core/pattern/pattern.h"
#include "solver/method/sample_noise.h"
#include "tests/solver/stack_of.h"

namespace glasswing {
namespace {

// --- Layout ---

v1::Frame& add_frame(v1::CaptureManifest& manifest, const std::string& kind, const std::string& panel,
                     std::array<double, 3> colour = {1.0, 1.0, 1.0}) {
  v1::Frame& frame = *manifest.add_frames();
  frame.set_file(std::to_string(manifest.frames_size()) + ".tif");
  frame.set_exposure_ms(10.0);
  frame.mutable_stimulus()->set_kind(kind);
  frame.mutable_stimulus()->set_panel(panel);
  for (const double value : colour) frame.mutable_stimulus()->add_colour(value);
  return frame;
}

void add_bars(v1::CaptureManifest& manifest, const std::string& panel, bool vertical, double width_px,
              bool inverse) {
  v1::Stimulus& bars = *add_frame(manifest, "square", panel).mutable_stimulus();
  bars.set_orient(vertical ? "vertical_bars" : "horizontal_bars");
  bars.set_bar_width_px(width_px);
  bars.set_inverse(inverse);
}

v1::CaptureManifest manifest_of(MonitorSize monitor, MonitorSize camera, double finest_bar_px) {
  v1::CaptureManifest manifest;
  v1::Monitor& back = *manifest.add_monitors();
  back.set_name("back");
  back.set_width_px(monitor.width_px);
  back.set_height_px(monitor.height_px);
  manifest.mutable_camera()->set_width_px(camera.width_px);
  manifest.mutable_camera()->set_height_px(camera.height_px);
  manifest.mutable_camera()->set_bits(16);
  add_frame(manifest, "solid", "back", {0.0, 0.0, 0.0});
  add_frame(manifest, "solid", "back");
  for (const bool vertical : {true, false}) {
    for (double bar_px = 32.0; bar_px >= finest_bar_px; bar_px *= 0.5) {
      add_bars(manifest, "back", vertical, bar_px, false);
      add_bars(manifest, "back", vertical, bar_px, true);
    }
  }
  return manifest;
}

TEST(LayOutEmptyStage, FindsEveryRole) {
  v1::CaptureManifest manifest = manifest_of({64, 48}, {20, 15}, 8.0);  // frames 0 to 13
  manifest.add_monitors()->set_name("left");
  add_frame(manifest, "solid", "back", {0.5, 0.5, 0.5});     // 14: darker than white
  add_frame(manifest, "solid", "left", {0.25, 0.25, 0.25});  // 15
  add_frame(manifest, "solid", "back", {0.0, 0.75, 0.0});    // 16: a colour
  add_bars(manifest, "left", true, 4.0, false);              // 17: without complement, but with white
  add_bars(manifest, "back", true, 2.0, true);               // 18: only the complement
  add_bars(manifest, "back", true, 4.0, false);              // 19: with the object
  manifest.mutable_frames(19)->set_object(true);
  add_bars(manifest, "back", true, 4.0, false);  // 20: shown for comparison
  manifest.mutable_frames(20)->mutable_stimulus()->set_reference(true);
  add_bars(manifest, "back", true, 4.0, false);  // 21: of another exposure
  manifest.mutable_frames(21)->set_exposure_ms(40.0);
  add_bars(manifest, "back", true, 0.5, false);  // 22: finer than the pixels
  const std::vector<EmptyMonitor> monitors = lay_out_empty_stage(manifest);
  ASSERT_EQ(monitors.size(), 2u);
  const EmptyMonitor& back = monitors[0];
  EXPECT_EQ(back.black, 0);
  EXPECT_EQ(back.white, 1);
  EXPECT_EQ(back.white_light, 1.0);
  ASSERT_EQ(back.bars[0].size(), 3u);
  ASSERT_EQ(back.bars[1].size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(back.bars[0][i].width_px, 32.0 / std::exp2(i));
    EXPECT_EQ(back.bars[0][i].frame, 2 + 2 * static_cast<int>(i));
    EXPECT_EQ(back.bars[0][i].inverse, 3 + 2 * static_cast<int>(i));
    EXPECT_EQ(back.bars[1][i].frame, 8 + 2 * static_cast<int>(i));
  }
  const EmptyMonitor& left = monitors[1];
  EXPECT_EQ(left.texture, 1);
  EXPECT_EQ(left.black, 0);
  EXPECT_EQ(left.white, 15);
  EXPECT_EQ(left.white_light, 0.25);
  ASSERT_EQ(left.bars[0].size(), 1u);
  EXPECT_EQ(left.bars[0][0].frame, 17);
  EXPECT_EQ(left.bars[0][0].inverse, -1);
  const std::vector<int> frames = frames_of(monitors);
  EXPECT_EQ(frames, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 15, 17}));
}

TEST(LayOutEmptyStage, AnArchiveWithoutSuchFramesIsNoError) {
  v1::CaptureManifest manifest;
  manifest.add_monitors()->set_name("back");
  const std::vector<EmptyMonitor> monitors = lay_out_empty_stage(manifest);
  ASSERT_EQ(monitors.size(), 1u);
  EXPECT_EQ(monitors[0].black, -1);
  EXPECT_EQ(monitors[0].white, -1);
  EXPECT_TRUE(frames_of(monitors).empty());
}

// --- The background map ---

// Continuous camera px to monitor px.
struct Affine {
  double a, b, c, d, e, f;
  std::array<double, 2> at(double x, double y) const { return {a * x + b * y + c, d * x + e * y + f}; }
};

constexpr Samples3 kWeights = {0.9, 0.7, 0.5};
constexpr double kForeground = 0.03;

struct Rig {
  v1::CaptureManifest manifest;
  std::vector<Image16> frames;
  FrameStack stack() const { return stack_of(manifest, frames); }
};

// Frames composited exactly from a known matte, with noise.
Rig rig_of(v1::CaptureManifest manifest, const Affine& affine, double sigma_px, double noise_sd) {
  const int width = manifest.camera().width_px(), height = manifest.camera().height_px();
  Matte matte(0, 0, width, height, 1);
  *matte.metadata.mutable_monitors() = manifest.monitors();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const auto [at_x, at_y] = affine.at(x + 0.5, y + 0.5);
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = static_cast<float>(kForeground);
        matte.modes(x, y, c)[0] = {.weight = static_cast<float>(kWeights[c]),
                                   .x_px = static_cast<float>(at_x),
                                   .y_px = static_cast<float>(at_y),
                                   .xx_px2 = static_cast<float>(sigma_px * sigma_px),
                                   .xy_px2 = 0.0f,
                                   .yy_px2 = static_cast<float>(sigma_px * sigma_px),
                                   .texture = 0};
      }
    }
  }
  const MonitorSize size{manifest.monitors(0).width_px(), manifest.monitors(0).height_px()};
  std::mt19937 random(5);
  std::normal_distribution<float> normal(0.0f, 1.0f);
  Rig rig{.manifest = manifest, .frames = {}};
  for (const v1::Frame& frame : manifest.frames()) {
    const RadianceImage background = Pattern::create(frame.stimulus(), size).value().rasterised();
    const RadianceImage seen = composite(matte, {background}).value();
    Image16 image(width, height);
    for (size_t i = 0; i < image.samples.size(); ++i) {
      image.samples[i] = code16_of(seen.samples[i] + static_cast<float>(noise_sd) * normal(random));
    }
    rig.frames.push_back(std::move(image));
  }
  return rig;
}

struct Measured {
  double centre_rms_px = 0.0, centre_worst_px = 0.0, weight_rms = 0.0;
  double log_sigma_rms = 0.0;  // of its sd
  double foreground_rms = 0.0, chi_square = 0.0;
  int pixels = 0, unseen = 0, ambiguous = 0, sigmas = 0;
};

// Errors over the pixels whose footprint lies on the monitor.
Measured measure(const Rig& rig, const Affine& affine, double sigma_px, double noise_sd) {
  const FrameStack stack = rig.stack();
  const EmptyMonitor monitor = lay_out_empty_stage(rig.manifest)[0];
  const BackgroundMap map(monitor, sample_noise(rig.manifest.camera(), noise_sd));
  Measured result;
  EmptyPixel pixel;
  for (int y = 0; y < stack.row_count; ++y) {
    for (int x = 0; x < rig.manifest.camera().width_px(); ++x) {
      const std::array<double, 2> truth = affine.at(x + 0.5, y + 0.5);
      const double margin_px = 3.0 * sigma_px;
      if (truth[0] < margin_px || truth[0] > monitor.width_px - margin_px) continue;
      if (truth[1] < margin_px || truth[1] > monitor.height_px - margin_px) continue;
      ++result.pixels;
      gather(stack, monitor, x, y, pixel);
      const BackgroundPoint point = map.point(pixel, straight_view(rig.manifest.camera(), monitor, x, y));
      if (!point.seen) {
        ++result.unseen;
        continue;
      }
      if (point.ambiguous) {
        ++result.ambiguous;
        continue;
      }
      for (size_t axis = 0; axis < 2; ++axis) {
        const double error_px = point.axis[axis].centre_px - truth[axis];
        result.centre_rms_px += error_px * error_px;
        result.centre_worst_px = std::max(result.centre_worst_px, std::abs(error_px));
        // Where the edges of four waves meet, all of them are 0 whatever sigma is.
        if (std::abs(std::remainder(truth[axis], 8.0)) < 0.1) continue;
        ++result.sigmas;
        result.log_sigma_rms +=
            std::pow(std::log(point.axis[axis].sigma_px / sigma_px) / point.axis[axis].log_sigma_sd, 2);
      }
      for (size_t c = 0; c < kChannels; ++c) {
        result.weight_rms += std::pow(point.weight[c] - kWeights[c], 2);
        result.foreground_rms += std::pow(point.foreground[c] - kForeground, 2);
      }
      result.chi_square += point.chi_square / point.degrees;
    }
  }
  const int count = result.pixels - result.unseen - result.ambiguous;
  result.centre_rms_px = std::sqrt(result.centre_rms_px / (2 * count));
  result.log_sigma_rms = std::sqrt(result.log_sigma_rms / result.sigmas);
  result.weight_rms = std::sqrt(result.weight_rms / (3 * count));
  result.foreground_rms = std::sqrt(result.foreground_rms / (3 * count));
  result.chi_square /= count;
  return result;
}

struct Geometry {
  const char* name;
  Affine affine;
};

class Registered : public testing::TestWithParam<Geometry> {};

// 64x48 monitor px in view of 20x15 camera px.
INSTANTIATE_TEST_SUITE_P(Geometries, Registered,
                         testing::Values(Geometry{"straight", {64.0 / 20, 0, 0, 0, 48.0 / 15, 0}},
                                         Geometry{"mirrored", {-64.0 / 20, 0, 64, 0, 48.0 / 15, 0}},
                                         Geometry{"upside_down", {-64.0 / 20, 0, 64, 0, -48.0 / 15, 48}},
                                         Geometry{"quarter_turn", {0, 64.0 / 15, 0, -48.0 / 20, 0, 48}},
                                         Geometry{"shifted_and_turned", {1.5, 0.3, 7.3, -0.3, 1.5, 11.1}},
                                         Geometry{"finer_camera", {0.4, 0.02, 20.2, -0.02, 0.4, 15.7}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(Registered, PlacesWidthsAndWeightsComeBackInNoise) {
  constexpr double kNoise = 0.01, kSigma = 0.6;
  const Rig rig = rig_of(manifest_of({64, 48}, {20, 15}, 1.0), GetParam().affine, kSigma, kNoise);
  const Measured measured = measure(rig, GetParam().affine, kSigma, kNoise);
  std::printf(
      "%s: %d pixels, centre %.3f px rms, %.2f worst, ln sigma %.2f sd, weight %.4f, F %.4f, chi2 %.2f\n",
      GetParam().name, measured.pixels, measured.centre_rms_px, measured.centre_worst_px,
      measured.log_sigma_rms, measured.weight_rms, measured.foreground_rms, measured.chi_square);
  EXPECT_GT(measured.pixels, 200);
  EXPECT_EQ(measured.unseen, 0);
  EXPECT_LE(measured.ambiguous, 2);
  // v has sd 0.01 sqrt(2) / 1.24 (three channels of weight 0.9, 0.7, 0.5 add up so) and slope at least about
  // 0.3 / px in the finest wave through this footprint.
  EXPECT_LT(measured.centre_rms_px, 0.06);
  EXPECT_LT(measured.centre_worst_px, 0.5);
  EXPECT_LT(measured.log_sigma_rms, 1.3);
  // Two times 6 levels in pairs, white and black: 26 samples, half of them lit: 0.01 / sqrt(6.5), plus a loss
  // from the edges in view.
  EXPECT_LT(measured.weight_rms, 0.006);
  EXPECT_LT(measured.foreground_rms, 0.004);
  // The positions use 4 of 12 degrees of freedom.
  EXPECT_LT(measured.chi_square, 1.1);
}

TEST_P(Registered, FromCoarseBarsNothingJumpsFurtherThanABar) {
  constexpr double kNoise = 0.01, kSigma = 0.6;
  const Rig rig = rig_of(manifest_of({64, 48}, {20, 15}, 8.0), GetParam().affine, kSigma, kNoise);
  const Measured measured = measure(rig, GetParam().affine, kSigma, kNoise);
  EXPECT_EQ(measured.unseen, 0);
  EXPECT_LT(measured.centre_worst_px, 8.0);
  EXPECT_LT(measured.weight_rms, 0.02);
}

TEST(BackgroundMap, PixelsThatLookPastTheMonitorHaveNoWeight) {
  constexpr double kNoise = 0.01;
  const Affine affine{6.0, 0, -30, 0, 6.0, -20};  // the monitor spans columns 5 to 15, rows 4 to 11
  const Rig rig = rig_of(manifest_of({64, 48}, {20, 15}, 1.0), affine, 0.8, kNoise);
  const FrameStack stack = rig.stack();
  const EmptyMonitor monitor = lay_out_empty_stage(rig.manifest)[0];
  const BackgroundMap map(monitor, sample_noise(rig.manifest.camera(), kNoise));
  EmptyPixel pixel;
  for (int y = 0; y < 15; ++y) {
    for (int x = 0; x < 20; ++x) {
      const auto [at_x, at_y] = affine.at(x + 0.5, y + 0.5);
      const double past_px = std::max({-at_x, at_x - 64.0, -at_y, at_y - 48.0});
      gather(stack, monitor, x, y, pixel);
      const BackgroundPoint point = map.point(pixel, straight_view(rig.manifest.camera(), monitor, x, y));
      if (past_px > 4.0) {  // 5 sigma
        EXPECT_FALSE(point.seen) << x << " " << y;
        EXPECT_EQ(point.mode(0, 0).weight, 0.0f);
      }
      if (past_px < 0.0) {
        EXPECT_TRUE(point.seen) << x << " " << y;
      }
      if (point.seen) {
        // A mode on the monitor, not a strong one far outside.
        EXPECT_GE(point.axis[0].centre_px, 0.0);
        EXPECT_LE(point.axis[0].centre_px, 64.0);
        EXPECT_LT(point.weight[0], 1.2);
      }
    }
  }
}

TEST(BackgroundMap, WithoutComplementsTheSolidsDo) {
  v1::CaptureManifest manifest = manifest_of({64, 48}, {20, 15}, 1.0);
  v1::CaptureManifest without = manifest;
  without.clear_frames();
  for (const v1::Frame& frame : manifest.frames()) {
    if (!frame.stimulus().inverse()) *without.add_frames() = frame;
  }
  const Affine affine{1.5, 0.3, 7.3, -0.3, 1.5, 11.1};
  const Measured measured = measure(rig_of(without, affine, 0.6, 0.005), affine, 0.6, 0.005);
  EXPECT_EQ(measured.unseen, 0);
  EXPECT_LT(measured.centre_rms_px, 0.08);
  EXPECT_LT(measured.weight_rms, 0.008);
}

TEST(BackgroundMap, WithoutSolidsTheBarsDo) {
  v1::CaptureManifest manifest = manifest_of({64, 48}, {20, 15}, 1.0);
  manifest.mutable_frames()->DeleteSubrange(0, 2);
  const Affine affine{1.5, 0.3, 7.3, -0.3, 1.5, 11.1};
  const Measured measured = measure(rig_of(manifest, affine, 0.6, 0.005), affine, 0.6, 0.005);
  EXPECT_EQ(measured.unseen, 0);
  // White - black is the mean of a few differences of bars, of 0.7 % each.
  EXPECT_LT(measured.centre_rms_px, 0.08);
  EXPECT_LT(measured.weight_rms, 0.008);
}

TEST(BackgroundMap, WithoutBarsTheViewIsStraight) {
  v1::CaptureManifest manifest = manifest_of({64, 48}, {32, 24}, 64.0);
  ASSERT_EQ(manifest.frames_size(), 2);
  const EmptyMonitor monitor = lay_out_empty_stage(manifest)[0];
  const BackgroundMap map(monitor, sample_noise(manifest.camera(), 0.01));
  const EmptyPixel pixel{.black = {0.1, 0.1, 0.1}, .white = {0.9, 0.8, 0.7}, .bars = {}};
  const BackgroundPoint point = map.point(pixel, straight_view(manifest.camera(), monitor, 10, 4));
  EXPECT_TRUE(point.seen);
  EXPECT_FALSE(point.measured[0] || point.measured[1]);
  const Mode mode = point.mode(1, 0);
  EXPECT_FLOAT_EQ(mode.weight, 0.7f);
  EXPECT_FLOAT_EQ(mode.x_px, 21.0f);
  EXPECT_FLOAT_EQ(mode.y_px, 9.0f);
  EXPECT_FLOAT_EQ(mode.xx_px2, 0.25f);  // (2^2 - 1) / 12
  // Nothing is known about a second monitor.
  EmptyMonitor second = monitor;
  second.texture = 1;
  EXPECT_FALSE(BackgroundMap(second, sample_noise(manifest.camera(), 0.01))
                   .point(pixel, straight_view(manifest.camera(), monitor, 10, 4))
                   .seen);
}

}  // namespace
}  // namespace glasswing
