#include "core/radiometry/display_calibration.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <functional>
#include <random>

#include "core/frame/archive.h"
#include "core/pattern/calibration_steps.h"
#include "core/pattern/id_patch.h"
#include "core/pattern/pattern.h"
#include "core/radiometry/screen_view.h"
#include "core/sim/fall_off.h"
#include "core/sim/panel.h"
#include "core/sim/sensor.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr MonitorSize kScreen{.width_px = 128, .height_px = 96};
constexpr int kPatchRows = 8, kLeft_px = 16, kTop_px = 6;  // in the camera's picture
constexpr int kWidth_px = 160, kHeight_px = 120;
constexpr double kGoal = 0.005;  // of full scale

// A monitor and a camera in front of it, pixel on pixel; below the screen its id patch, and below that, the
// table mirrors it.
struct Rig {
  int bits = 8;
  std::function<double(double)> tone;  // instead of panel.gamma: light of a code, both in [0, 1]
  PanelModel panel{.bits = 8, .gamma = 2.2, .black = 0.004, .crosstalk = 0.05, .falloff = 0.15};
  SensorModel sensor{.read_sd = 0.001,
                     .gain = 2e-5,
                     .vignetting = 0.2,
                     .black_level = 0.02,
                     .curve = {.exponent = 0.5f, .contrast = 0.6f},
                     .bits = 10};
  // As declared, and as they are.
  std::vector<std::pair<double, double>> exposures_ms{{4.0, 4.0}};
  int grays = 17, takes = 2;
  nanoseconds between = std::chrono::milliseconds(100);  // frames
  float room = 0.0f;                                     // light that the screen mirrors
  bool calibrated = true;
  double curve_off = 0.0, waves = 0.5;  // of the calibration's curve, at most
  std::string response = "unknown";
  // What goes wrong with the light, or the frame.
  std::function<void(v1::Frame&, RadianceImage&)> disturb = [](v1::Frame&, RadianceImage&) {};

  double share_of(double code) const { return tone ? tone(code) : std::pow(code, panel.gamma); }
};

// The linear value that the sensor's curve makes this code of.
double linear_of(const SensorCurve& curve, double code) {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high), u = std::pow(middle, curve.exponent);
    const double made = (1.0 - curve.contrast) * u + curve.contrast * (3.0 * u * u - 2.0 * u * u * u);
    (made < code ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

constexpr double kSaturation = 0.99;
// Light is on the scale on which that of code kSaturation is 1.
double light_of_code(const SensorModel& sensor, double code) {
  const auto above = [&](double z) { return linear_of(sensor.curve, z) - sensor.black_level; };
  return above(code) / above(kSaturation);
}
// And a value of sensor.h this.
double light_of_value(const SensorModel& sensor, double value) {
  return (1.0 - sensor.black_level) * value / (linear_of(sensor.curve, kSaturation) - sensor.black_level);
}

v1::CameraCalibration camera_calibration(const Rig& rig) {
  v1::CameraCalibration calibration;
  calibration.set_format_version(1);
  calibration.set_camera("front");
  calibration.set_saturation(kSaturation);
  const int highest = (1 << rig.sensor.bits) - 1;
  for (int c = 0; c < 3; ++c) {
    v1::CameraCurve& curve = *calibration.add_curves();
    for (int k = 0; k <= highest; ++k) {
      const double light = light_of_code(rig.sensor, static_cast<double>(k) / highest);
      curve.add_light(static_cast<float>(light + rig.curve_off * std::sin(2.0 * M_PI * rig.waves * light)));
    }
  }
  calibration.mutable_fall_off()->set_r2(-rig.sensor.vignetting);
  return calibration;
}

v1::Monitor monitor_of(const Rig& rig) {
  v1::Monitor monitor;
  monitor.set_name("back");
  monitor.set_width_px(kScreen.width_px);
  monitor.set_height_px(kScreen.height_px);
  monitor.set_patch_rows(kPatchRows);
  monitor.set_bits(rig.bits);
  return monitor;
}

v1::CaptureManifest header_of(const Rig& rig) {
  v1::CaptureManifest header;
  header.set_session("grays");
  *header.add_monitors() = monitor_of(rig);
  header.mutable_camera()->set_name("front");
  header.mutable_camera()->set_width_px(kWidth_px);
  header.mutable_camera()->set_height_px(kHeight_px);
  header.mutable_camera()->set_response(rig.response);
  header.mutable_plan()->set_method("calibration");
  header.mutable_plan()->mutable_calibration()->set_of("display");
  header.mutable_plan()->mutable_calibration()->set_grays(rig.grays);
  header.mutable_plan()->mutable_calibration()->set_takes(rig.takes);
  if (rig.calibrated) *header.mutable_camera_calibration() = camera_calibration(rig);
  return header;
}

// Of the screen and the strip below it.
RadianceImage emitted(const Rig& rig, const v1::Stimulus& stimulus, int id, nanoseconds lit) {
  const RadianceImage shares = Pattern::create(stimulus, kScreen).value().rasterised();
  const double highest = std::exp2(rig.bits) - 1.0;
  PanelModel model = rig.panel;
  if (rig.tone) model.bits = 16, model.gamma = 1.0;
  Image16 codes(kScreen.width_px, kScreen.height_px);
  for (size_t i = 0; i < codes.samples.size(); ++i) {
    const double code = std::round(shares.samples[i] * highest);
    const double sent = rig.tone ? std::round(65535.0 * rig.tone(code / highest)) : code;
    codes.samples[i] = static_cast<std::uint16_t>(sent);
  }
  const Image16 screen = Panel(model).emitted(std::move(codes), lit);
  RadianceImage all(kScreen.width_px, kScreen.height_px + kPatchRows);
  for (size_t i = 0; i < screen.samples.size(); ++i) all.samples[i] = radiance_of(screen.samples[i]);
  IdPatch{.width_px = kScreen.width_px, .first_row = kScreen.height_px, .rows = kPatchRows}.draw(
      static_cast<std::uint16_t>(id), all);
  return all;
}

RadianceImage seen(const Rig& rig, const RadianceImage& monitor) {
  RadianceImage light(kWidth_px, kHeight_px);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const int u = x - kLeft_px, v = y - kTop_px, mirrored = 2 * monitor.height_px - 1 - v;
      const bool direct = v >= 0 && v < monitor.height_px;
      if (u < 0 || u >= monitor.width_px || v < 0) continue;
      for (int c = 0; c < 3; ++c) {
        light.at(x, y, c) = rig.room + (direct ? monitor.at(u, v, c) : 0.2f * monitor.at(u, mirrored, c));
      }
    }
  }
  return light;
}

class DisplayCalibrationTest : public testing::Test {
 protected:
  void TearDown() override { fs::remove_all(directory_); }

  std::shared_ptr<const MappedArchive> captured(
      const Rig& rig, const std::function<void(v1::CaptureManifest&)>& change = [](v1::CaptureManifest&) {}) {
    fs::remove_all(directory_);
    v1::CaptureManifest header = header_of(rig);
    change(header);
    const auto archive = Archive::create(directory_, header).value();
    std::vector<Archive::NewFrame> frames;
    const auto stimuli = calibration_stimuli(header.plan().calibration(), header.monitors(0));
    for (int i = 0; i < static_cast<int>(stimuli.size()); ++i) {
      for (const auto& [declared_ms, real_ms] : rig.exposures_ms) {
        const int step = static_cast<int>(frames.size());
        v1::Frame record;
        *record.mutable_stimulus() = stimuli[static_cast<size_t>(i)];
        record.set_step(step);
        record.set_exposure_ms(declared_ms);
        record.set_exposure_start_ns((1 + step) * rig.between.count());
        RadianceImage light = seen(rig, emitted(rig, record.stimulus(), i, step * rig.between));
        rig.disturb(record, light);
        if (record.stimulus().kind().empty()) continue;  // lost
        frames.push_back({.record = record, .image = expose(light, real_ms, rig.sensor, step)});
      }
    }
    EXPECT_TRUE(archive->add(frames).ok());
    EXPECT_TRUE(archive->seal().ok());
    return MappedArchive::open(directory_).value();
  }
  v1::DisplayCalibration calibrated(const Rig& rig) {
    return calibrate_displays(*captured(rig)).value().at(0);
  }
  std::string refusal(const Rig& rig) {
    const absl::Status status = calibrate_displays(*captured(rig)).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    return std::string(status.message());
  }

  const fs::path directory_ =
      fs::path(testing::TempDir()) / ("display_calibration_test." + std::to_string(::getpid()));
};

double worst_curve_error(const v1::DisplayCalibration& calibration, const Rig& rig, double up_to = 1.0) {
  const int highest = (1 << rig.bits) - 1;
  const double dark = rig.share_of(0.0), bright = rig.share_of(1.0);
  double worst = 0.0;
  EXPECT_EQ(calibration.primaries_size(), 3);
  for (const v1::ToneCurve& curve : calibration.primaries()) {
    EXPECT_EQ(curve.radiance_size(), highest + 1);
    EXPECT_EQ(curve.error_size(), highest + 1);
    for (int k = 0; k <= up_to * highest; ++k) {
      const double truth = (rig.share_of(static_cast<double>(k) / highest) - dark) / (bright - dark);
      worst = std::max(worst, std::abs(curve.radiance(k) - truth));
    }
  }
  return worst;
}

// Of what each channel sees of white above black.
double worst_crosstalk_error(const v1::DisplayCalibration& calibration, const Rig& rig) {
  double worst = 0.0;
  for (int c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (int p = 0; p < 3; ++p) sum += calibration.crosstalk(3 * c + p);
    for (int p = 0; p < 3; ++p) {
      const double truth = c == p ? 1.0 - 2.0 * rig.panel.crosstalk : rig.panel.crosstalk;
      worst = std::max(worst, std::abs(calibration.crosstalk(3 * c + p) / sum - truth));
    }
  }
  return worst;
}

double black_over_white(const v1::DisplayCalibration& calibration, int c) {
  double white = calibration.black(c);
  for (int p = 0; p < 3; ++p) white += calibration.crosstalk(3 * c + p);
  return calibration.black(c) / white;
}

double worst_uniformity_error(const v1::Uniformity& uniformity, const Rig& rig) {
  const auto mean = [&](int column, int row) {
    const int wide = kScreen.width_px / uniformity.columns(), high = kScreen.height_px / uniformity.rows();
    double sum = 0.0;
    for (int y = row * high; y < (row + 1) * high; ++y) {
      for (int x = column * wide; x < (column + 1) * wide; ++x)
        sum += fall_off(rig.panel.falloff, x, y, kScreen.width_px, kScreen.height_px);
    }
    return sum / (wide * high);
  };
  const double middle = mean(uniformity.columns() / 2, uniformity.rows() / 2);  // as its three neighbours
  double worst = 0.0;
  for (int row = 0; row < uniformity.rows(); ++row) {
    for (int column = 0; column < uniformity.columns(); ++column) {
      const double light = uniformity.light(row * uniformity.columns() + column);
      worst = std::max(worst, std::abs(light - mean(column, row) / middle));
    }
  }
  return worst;
}

void says(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}
// One warning, and it says this.
void warns(const v1::DisplayCalibration& calibration, const std::string& part) {
  ASSERT_EQ(calibration.warnings_size(), 1) << fmt::format("{}", fmt::join(calibration.warnings(), "; "));
  says(calibration.warnings(0), part);
}

// Gamma 2.2 with a black level and crosstalk, a camera of 10 bits with an S curve, noise and fall-off.
TEST_F(DisplayCalibrationTest, RecoversTheMonitor) {
  const Rig rig;
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_EQ(calibration.format_version(), 1);
  EXPECT_EQ(calibration.monitor(), "back");
  EXPECT_EQ(calibration.session(), "grays");
  EXPECT_EQ(calibration.camera(), "front");
  EXPECT_EQ(calibration.width_px(), kScreen.width_px);
  EXPECT_EQ(calibration.height_px(), kScreen.height_px);
  EXPECT_EQ(calibration.bits(), 8);
  EXPECT_EQ(calibration.exposure_ms(), 4.0);
  EXPECT_EQ(calibration.measured().size(), std::string("2026-01-31T12:00:00Z").size());

  const double curve = worst_curve_error(calibration, rig),
               crosstalk = worst_crosstalk_error(calibration, rig);
  const double uniformity = worst_uniformity_error(calibration.uniformity(), rig);
  std::printf("worst errors: curves %.3f %%, crosstalk %.3f %%, uniformity %.2f %%\n", 100.0 * curve,
              100.0 * crosstalk, 100.0 * uniformity);
  EXPECT_LE(curve, kGoal);
  EXPECT_LE(crosstalk, kGoal);
  // A pixel's noise of 0.1 to 0.2 % of full scale is 0.03 of the screen's width where the ramp is dark, half
  // a cell; over half a cell, the light at a corner falls by 0.15 * 2 * 0.03.
  EXPECT_LE(uniformity, 0.01);
  // Of 2 x 7 blacks of some 10000 pixels, four errors are below 0.001 %; 10 bits are steps of 0.03 % there.
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(black_over_white(calibration, c), rig.panel.black, 1e-4);
  for (const v1::ToneCurve& of : calibration.primaries()) EXPECT_NEAR(of.gamma(), 2.2, 0.02);
  EXPECT_LT(calibration.drift(), 0.001);
  EXPECT_LT(std::abs(calibration.excess_of_white()), 0.001);
  EXPECT_EQ(calibration.warnings_size(), 0) << calibration.warnings(0);
}

// The scale of light is the camera's.
TEST_F(DisplayCalibrationTest, LightIsOnTheCamerasScale) {
  Rig rig;
  rig.panel.falloff = rig.sensor.vignetting = 0.0;
  const v1::DisplayCalibration calibration = calibrated(rig);
  const double full = light_of_value(rig.sensor, 4.0 / rig.sensor.full_scale_exposure_ms);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(calibration.black(c), full * rig.panel.black, 1e-4);
    for (int p = 0; p < 3; ++p) {
      const double kept = c == p ? 1.0 - 2.0 * rig.panel.crosstalk : rig.panel.crosstalk;
      EXPECT_NEAR(calibration.crosstalk(3 * c + p), full * kept * (1.0 - rig.panel.black), kGoal);
    }
  }
}

TEST_F(DisplayCalibrationTest, OtherTones) {
  const auto srgb = [](double code) {
    return code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4);
  };
  const auto s_shaped = [](double code) { return std::pow(code, 2.2) + 0.01 * std::sin(2.0 * M_PI * code); };
  for (const int bits : {8, 10}) {
    for (const auto& tone : {std::function<double(double)>(srgb), std::function<double(double)>(s_shaped)}) {
      Rig rig;
      rig.bits = bits;
      rig.tone = tone;
      const v1::DisplayCalibration calibration = calibrated(rig);
      const double curve = worst_curve_error(calibration, rig);
      std::printf("%d bits: curves %.3f %%\n", bits, 100.0 * curve);
      EXPECT_LE(curve, kGoal);
      EXPECT_LE(worst_crosstalk_error(calibration, rig), kGoal);
      EXPECT_EQ(calibration.warnings_size(), 0) << calibration.warnings(0);
    }
  }
}

// A camera whose calibration is off by 0.3 % of full scale: light l, of which the brightest is a, becomes l +
// off(l), and the curve at L = l / a is off by (off(l) - L off(a)) / a; a is 0.7. One bend of it is within
// the goal; of a whole wave, both ends of the scale add up.
TEST_F(DisplayCalibrationTest, CamerasCurveIsOff) {
  for (const auto& [waves, most] : {std::pair(0.5, kGoal), {1.0, (0.003 + 0.5 * 0.003) / 0.7}}) {
    Rig rig;
    rig.curve_off = 0.003;
    rig.waves = waves;
    const v1::DisplayCalibration calibration = calibrated(rig);
    std::printf("%.1f waves of 0.3 %%: curves %.2f %%\n", waves, 100.0 * worst_curve_error(calibration, rig));
    EXPECT_LE(worst_curve_error(calibration, rig), most);
    EXPECT_LE(worst_crosstalk_error(calibration, rig), kGoal);
  }
}

TEST_F(DisplayCalibrationTest, LinearCameraWithoutCalibration) {
  Rig rig;
  rig.calibrated = false;
  rig.response = "linear";
  rig.sensor.black_level = 0.0;
  rig.sensor.curve = {};
  rig.sensor.bits = 12;
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_LE(worst_curve_error(calibration, rig), kGoal);
  EXPECT_LE(worst_crosstalk_error(calibration, rig), kGoal);
}

TEST_F(DisplayCalibrationTest, DriftIsTakenOutAndTold) {
  Rig rig;
  rig.panel.drift_per_minute = 0.15;
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_LE(worst_curve_error(calibration, rig), kGoal);
  EXPECT_LE(worst_crosstalk_error(calibration, rig), kGoal);
  EXPECT_LT(std::abs(calibration.excess_of_white()), 0.003);
  // From the second picture, the first white, to the last but one.
  const auto stimuli = calibration_stimuli(header_of(rig).plan().calibration(), monitor_of(rig));
  const double minutes = static_cast<double>(stimuli.size() - 3) * 0.1 / 60.0;
  EXPECT_NEAR(calibration.drift(), std::pow(1.0 - 0.15, -minutes) - 1.0, 0.001);
  warns(calibration, "% while it was measured, which was taken out: let the monitor warm up");
}

// A camera of 8 bits with so little noise that its steps, of 0.4 % of full scale, do not average out. Longer
// exposures tell dark grays better, whatever the shutter says its times are.
TEST_F(DisplayCalibrationTest, DarkGraysFromLongerExposures) {
  Rig rig;
  rig.sensor.read_sd = 0.0003;
  rig.sensor.gain = 0.0;
  rig.sensor.black_level = 0.05;
  rig.sensor.curve = {};
  rig.sensor.bits = 8;
  const double dark = 0.2;  // codes below this share; 0.03 of full scale
  const double one = worst_curve_error(calibrated(rig), rig, dark);
  rig.exposures_ms = {{4.0, 4.0}, {16.0, 16.3}, {64.0, 62.0}};
  const v1::DisplayCalibration calibration = calibrated(rig);
  const double several = worst_curve_error(calibration, rig, dark);
  std::printf("dark codes: %.4f %% with one exposure, %.4f %% with three\n", 100.0 * one, 100.0 * several);
  EXPECT_EQ(calibration.exposure_ms(), 4.0);
  EXPECT_LT(several, one);
  EXPECT_LE(worst_curve_error(calibration, rig), kGoal);
  EXPECT_LE(worst_crosstalk_error(calibration, rig), kGoal);
}

TEST_F(DisplayCalibrationTest, SeesTheScreenAndNotItsPatchOrTheTable) {
  const Rig rig;
  const auto archive = captured(rig);
  const FrameLight light = FrameLight::create(archive->manifest()).value();
  const ShownFrames shown = shown_frames(archive->manifest(), archive->manifest().monitors(0));
  const ScreenView view = find_screen(*archive, light, shown, 8).value();
  for (const std::uint32_t pixel : view.pixels) {
    const int x = static_cast<int>(pixel) % kWidth_px - kLeft_px;
    const int y = static_cast<int>(pixel) / kWidth_px - kTop_px;
    ASSERT_TRUE(x > 0 && x < kScreen.width_px - 1 && y > 0 && y < kScreen.height_px - 1) << x << " " << y;
  }
  // But for its rim, which is 3 % of it.
  EXPECT_GT(view.pixels.size(), 0.95 * kScreen.width_px * kScreen.height_px);
}

TEST_F(DisplayCalibrationTest, TellsWhiteThatIsNoSum) {
  Rig rig;
  rig.disturb = [](v1::Frame& frame, RadianceImage& light) {
    const auto& colour = frame.stimulus().colour();
    if (frame.stimulus().kind() == "solid" && colour.Get(0) * colour.Get(1) * colour.Get(2) == 1.0) {
      for (float& of : light.samples) of *= 0.97f;
    }
  };
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_NEAR(calibration.excess_of_white(), 1.0 - 1.0 / 0.97, 0.002);
  warns(calibration, "white is 3.1 % darker than its primaries together");
}

TEST_F(DisplayCalibrationTest, TellsFlicker) {
  Rig rig;
  std::mt19937 random(1);
  std::normal_distribution<float> normal(1.0f, 0.006f);
  rig.disturb = [&](v1::Frame&, RadianceImage& light) {
    const float flicker = normal(random);
    for (float& of : light.samples) of *= flicker;
  };
  const v1::DisplayCalibration calibration = calibrated(rig);
  warns(calibration, "% from one time to the next: the monitor flickers");
}

TEST_F(DisplayCalibrationTest, TellsThatWhiteIsDark) {
  Rig rig;
  rig.exposures_ms = {{0.7, 0.7}};
  warns(calibrated(rig), "% of the camera's full scale at 0.7 ms: use an exposure of about");
}

TEST_F(DisplayCalibrationTest, TellsRoomLight) {
  Rig rig;
  rig.room = 0.03f;
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_LE(worst_curve_error(calibration, rig), kGoal);
  warns(calibration, "% of white: darken the room");
}

TEST_F(DisplayCalibrationTest, TellsCodesThatDoNothing) {
  // A monitor that takes codes for those of a television.
  Rig rig;
  rig.tone = [](double code) { return std::pow(std::clamp((255.0 * code - 16.0) / 219.0, 0.0, 1.0), 2.2); };
  v1::DisplayCalibration calibration = calibrated(rig);
  ASSERT_EQ(calibration.warnings_size(), 3);
  says(calibration.warnings(0), "red: codes 0 to 16 are equally dark, and 239 to 255 are equally bright");
  says(calibration.warnings(2), "blue: codes 0 to 16");

  // One of 5 bits, with grays 4 codes apart.
  rig.tone = [](double code) { return std::pow(std::floor(255.0 * code / 8.0) / 31.0, 2.2); };
  rig.grays = 65;
  rig.takes = 1;
  calibration = calibrated(rig);
  ASSERT_EQ(calibration.warnings_size(), 3);
  says(calibration.warnings(1), "does the monitor, its cable or its driver carry fewer bits than 8?");
}

TEST_F(DisplayCalibrationTest, TellsThatPartOfTheScreenIsHidden) {
  const auto hide = [](int from) {
    return [from](v1::Frame&, RadianceImage& light) {
      for (int y = 0; y < kHeight_px; ++y) {
        for (int x = kLeft_px + from; x < kWidth_px; ++x) {
          for (int c = 0; c < 3; ++c) light.at(x, y, c) = 0.0f;
        }
      }
    };
  };
  Rig rig;
  rig.disturb = hide(48);
  const v1::DisplayCalibration calibration = calibrated(rig);
  EXPECT_LE(worst_curve_error(calibration, rig), kGoal);
  EXPECT_FALSE(calibration.has_uniformity());
  warns(calibration, "the camera sees less than half of the screen");
  // Two columns of cells more than three quarters, which are seen; the others are like their neighbours.
  rig.disturb = hide(112);
  const v1::Uniformity uniformity = calibrated(rig).uniformity();
  for (int row = 0; row < 12; ++row) {
    for (int column = 14; column < 16; ++column) {
      const float light = uniformity.light(16 * row + column);
      EXPECT_GT(light, 1.0 - rig.panel.falloff);
      EXPECT_LT(light, 1.0);
    }
  }
  rig.disturb = hide(5);  // three columns but for the rim
  says(refusal(rig), "of the camera's pixels see its picture; it must be 300 or more");
}

TEST_F(DisplayCalibrationTest, SaysWhatItLacks) {
  Rig rig;
  rig.grays = 6;
  rig.takes = 1;
  const auto with = [&](const std::function<void(Rig&)>& change) {
    Rig changed = rig;
    change(changed);
    return refusal(changed);
  };
  const auto lost = [](const std::function<bool(const v1::Stimulus&)>& is) {
    return [is](v1::Frame& frame, RadianceImage&) {
      if (is(frame.stimulus())) frame.clear_stimulus();
    };
  };
  says(with([](Rig& of) { of.calibrated = false; }), "camera \"front\" codes light in a way of its own");
  says(with([](Rig& of) {
         of.exposures_ms = {{8.0, 8.0}};
       }),
       "monitor \"back\": white is cut off at the camera's full scale, even at 8 ms");
  says(with([](Rig& of) {
         of.exposures_ms = {{0.02, 0.02}};
       }),
       "monitor \"back\": white is brighter than black by only 0.00");
  says(with([&](Rig& of) { of.disturb = lost([](const auto& is) { return is.kind() == "ramp"; }); }),
       "monitor \"back\": the ramp was not shown");
  says(with([&](Rig& of) { of.disturb = lost([](const auto& is) { return is.colour(1) == 1.0; }); }),
       "black and white were not both shown with an exposure of 4 ms");
  says(with([&](Rig& of) {
         of.disturb = lost([](const auto& is) { return is.kind() == "solid" && is.colour(0) == 0.4; });
       }),
       "red: ");
  says(with([](Rig& of) {
         of.disturb = [](v1::Frame& frame, RadianceImage&) { frame.mutable_stimulus()->set_codes(false); };
       }),
       "session \"grays\" has no frames of any monitor's codes");
  says(with([](Rig& of) {
         of.disturb = [](v1::Frame& frame, RadianceImage&) { frame.set_exposure_start_ns(0); };
       }),
       "its frames do not say when they were exposed");
  // An automatic exposure that halves bright pictures.
  says(with([](Rig& of) {
         of.disturb = [](v1::Frame& frame, RadianceImage& light) {
           if (frame.step() < 10) return;
           for (float& sample : light.samples) sample *= 0.5f;
         };
       }),
       "is auto exposure or auto gain on");
  const auto archive = captured(rig, [](v1::CaptureManifest& header) { header.mutable_plan()->Clear(); });
  says(std::string(calibrate_displays(*archive).status().message()), "shows no calibration of displays");
}

}  // namespace
}  // namespace glasswing
