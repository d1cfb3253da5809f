#include "core/calibration/camera_calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/frame/archive.h"
#include "core/pattern/calibration_steps.h"
#include "core/sim/radial_shading.h"
#include "core/sim/sensor.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 160, kHeight = 120,
              kRim = 6;  // distance of the monitors' light from the picture's edge
constexpr double kMaxExposure_ms = 40.0;
constexpr double kVignetting = 0.3;
constexpr std::array<double, 3> kWhite = {0.9, 1.0, 0.8};
constexpr double kGlow = 0.002, kRoom = 0.003;  // light of a monitor at code 0; of the room

std::vector<double> ladder_ms() {
  std::vector<double> out;
  for (const double part : {1.0, 1.6, 2.9, 5.1, 8.3, 15.0, 25.0, 43.0}) out.push_back(kMaxExposure_ms / part);
  return out;
}

SensorModel camera(SensorCurve curve, double black_level) {
  SensorModel sensor;
  sensor.read_sd = 0.002;
  sensor.gain = 1e-4;
  sensor.vignetting = kVignetting;
  sensor.black_level = black_level;
  sensor.curve = curve;
  sensor.bits = 10;
  sensor.full_scale_exposure_ms = kMaxExposure_ms / 8.0;
  return sensor;
}
const SensorModel kLinear = camera({}, 0.05), kGamma = camera({.exponent = 1.0f / 2.2f}, 0.02),
                  kS = camera({.exponent = 1.0f / 2.2f, .contrast = 0.2f}, 0.02);

double code_of(const SensorModel& sensor, double value) {
  const double linear = sensor.black_level + (1.0 - sensor.black_level) * value;
  const double u = std::pow(linear, static_cast<double>(sensor.curve.exponent)),
               contrast = static_cast<double>(sensor.curve.contrast);
  return (1.0 - contrast) * u + contrast * u * u * (3.0 - 2.0 * u);
}

// Misbehaviour of a camera between frames: `exposure_ms` is the actual exposure.
struct Shot {
  int step = 0, take = 0, exposure = 0;
  double exposure_ms = 0.0;
  double mean = 0.0;  // mean radiance of the scene
  std::array<double, 3> gains = {1.0, 1.0, 1.0};
};
using Meddle = std::function<void(Shot&)>;

struct Rig {
  std::vector<double> exposures_ms = ladder_ms();
  std::vector<double> brightness = {1.0};  // by monitor, side by side
  Meddle meddle = [](Shot&) {};
};

std::string joined(const v1::CameraCalibration& calibration) {
  std::string all;
  for (const std::string& warning : calibration.warnings()) all += warning + "\n";
  return all;
}
bool warns(const v1::CameraCalibration& calibration, const std::string& of) {
  return joined(calibration).find(of) != std::string::npos;
}
bool warns_only(const v1::CameraCalibration& calibration, const std::string& of) {
  return calibration.warnings_size() == 1 && warns(calibration, of);
}
bool says(const absl::Status& status, absl::string_view what) {
  return status.code() == absl::StatusCode::kFailedPrecondition &&
         status.message().find(what) != absl::string_view::npos;
}

class CameraCalibrationTest : public testing::Test {
 protected:
  void TearDown() override { fs::remove_all(directory_); }

  static RadianceImage scene(const Rig& rig, size_t lit, const v1::Stimulus& shown) {
    RadianceImage image(kWidth, kHeight);
    const int each = (kWidth - 2 * kRim) / static_cast<int>(rig.brightness.size());
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const int m = (x - kRim) / each;
        const bool on = x >= kRim && x < kRim + each * static_cast<int>(rig.brightness.size()) && y >= kRim &&
                        y < kHeight - kRim;
        double share = 0.0;
        if (on && static_cast<size_t>(m) == lit) {
          const double across = (x - kRim - m * each + 0.5) / each - 0.5;
          share = shown.kind() == "solid" ? shown.colour(0) : std::exp(-0.5 * 64.0 * across * across);
        }
        for (int c = 0; c < 3; ++c) {
          const double of_monitor = on ? kGlow + std::pow(share, 2.2) : 0.0;
          const double brightness = on ? rig.brightness[m] : 0.0;
          image.at(x, y, c) = static_cast<float>(kRoom + brightness * kWhite[c] * of_monitor);
        }
      }
    }
    return image;
  }

  void capture(const SensorModel& sensor, const Rig& rig = {}) {
    fs::remove_all(directory_);
    v1::CaptureManifest header;
    header.set_session("calibration");
    v1::Camera& of = *header.mutable_camera();
    of.set_name("main");
    of.set_width_px(kWidth);
    of.set_height_px(kHeight);
    of.set_bits(sensor.bits);
    header.mutable_plan()->set_method("calibration");
    header.mutable_plan()->mutable_calibration()->set_of("camera");
    for (const double exposure_ms : rig.exposures_ms) header.mutable_plan()->add_exposure_ms(exposure_ms);
    for (size_t m = 0; m < rig.brightness.size(); ++m) {
      v1::Monitor& monitor = *header.add_monitors();
      monitor.set_name("monitor " + std::to_string(m));
      monitor.set_width_px(320);
      monitor.set_height_px(240);
    }
    const auto archive = Archive::create(directory_, header).value();
    std::vector<Archive::NewFrame> frames;
    for (size_t j = 0; j < rig.exposures_ms.size(); ++j) {
      for (size_t m = 0; m < rig.brightness.size(); ++m) {
        const auto stimuli =
            calibration_stimuli(header.plan().calibration(), header.monitors(static_cast<int>(m)));
        for (size_t i = 0; i < stimuli.size(); ++i) {
          RadianceImage light = scene(rig, m, stimuli[i]);
          double mean = 0.0;
          for (const float radiance : light.samples)
            mean += static_cast<double>(radiance) / static_cast<double>(light.samples.size());
          Shot shot{.step = static_cast<int>(frames.size()),
                    .take = static_cast<int>(i / 3),
                    .exposure = static_cast<int>(j),
                    .exposure_ms = rig.exposures_ms[j],
                    .mean = mean};
          rig.meddle(shot);
          for (size_t k = 0; k < light.samples.size(); ++k)
            light.samples[k] *= static_cast<float>(shot.gains[k % 3]);
          Archive::NewFrame frame;
          frame.record.set_step(shot.step);
          frame.record.set_exposure_ms(rig.exposures_ms[j]);
          *frame.record.mutable_stimulus() = stimuli[i];
          frame.image = expose(light, shot.exposure_ms, sensor, shot.step);
          frames.push_back(std::move(frame));
        }
      }
    }
    ASSERT_OK(archive->add(frames));
    ASSERT_OK(archive->seal());
  }
  absl::StatusOr<v1::CameraCalibration> calibrate() const {
    return calibrate_camera(*MappedArchive::open(directory_).value());
  }
  v1::CameraCalibration calibrated(const SensorModel& sensor, const Rig& rig = {}) {
    capture(sensor, rig);
    return calibrate().value();
  }

  const TemporaryDirectory directory_;
};

// The response at every code between black and full scale, all of which the stripe reaches at some exposure.
void expect_curves(const SensorModel& sensor, const v1::CameraCalibration& calibration) {
  EXPECT_EQ(calibration.saturation(), 1.0);
  ASSERT_EQ(calibration.curves_size(), 3);
  for (const v1::CameraCurve& curve : calibration.curves()) {
    EXPECT_NEAR(curve.black_level(), code_of(sensor, 0.0), 0.5 / 1023.0);
    EXPECT_GT(curve.brightest_seen(), 0.95);
    for (double value = 0.0; value <= 1.0; value += 0.002) {
      const double at = code_of(sensor, value) * (curve.light_size() - 1);
      const int knot = std::min(static_cast<int>(at), curve.light_size() - 2);
      const double light =
          curve.light(knot) + (at - knot) * static_cast<double>(curve.light(knot + 1) - curve.light(knot));
      EXPECT_NEAR(light, value, 0.005);  // the goal
    }
  }
}

// Four standard errors, plus quantisation: a twelfth of a squared step, in light.
void expect_noise(const SensorModel& sensor, const v1::CameraCalibration& calibration) {
  const double step = 1.0 / 1023.0;
  const auto light_per_code = [&](double value) {
    return 0.01 / (code_of(sensor, value + 0.005) - code_of(sensor, value - 0.005));
  };
  const double dark = std::pow(step * light_per_code(0.005), 2) / 12.0,
               bright = std::pow(step * light_per_code(0.99), 2) / 12.0;
  const double read_sd = std::sqrt(sensor.read_sd * sensor.read_sd + dark);
  EXPECT_NEAR(calibration.read_sd(), read_sd, 4.0 * calibration.read_sd_error());
  EXPECT_NEAR(calibration.shot_gain(), sensor.gain,
              4.0 * calibration.shot_gain_error() + std::abs(bright - dark));
  EXPECT_LT(calibration.read_sd_error(), 0.05 * sensor.read_sd);
  EXPECT_LT(calibration.shot_gain_error(), 0.05 * sensor.gain);
}

void expect_fall_off(const v1::CameraCalibration& calibration) {
  ASSERT_TRUE(calibration.has_fall_off());
  for (double r2 = 0.0; r2 <= 1.0; r2 += 0.05) {
    // As accurate as the curve: half a percent.
    EXPECT_NEAR(1.0 + calibration.fall_off().r2() * r2 + calibration.fall_off().r4() * r2 * r2,
                1.0 - kVignetting * r2, 0.005)
        << r2;
  }
}

TEST_F(CameraCalibrationTest, MeasuresCamerasOfAllKinds) {
  for (SensorModel sensor : {kLinear, kGamma, kS}) {
    for (const std::uint64_t seed : {1, 2, 3}) {
      SCOPED_TRACE(testing::Message() << "exponent " << sensor.curve.exponent << " contrast "
                                      << sensor.curve.contrast << " seed " << seed);
      sensor.seed = seed;
      const v1::CameraCalibration calibration = calibrated(sensor);
      EXPECT_EQ(calibration.linear(), sensor.curve == SensorCurve{});
      expect_curves(sensor, calibration);
      expect_noise(sensor, calibration);
      expect_fall_off(calibration);
      EXPECT_NEAR(calibration.white_ms(), sensor.full_scale_exposure_ms,
                  0.02 * sensor.full_scale_exposure_ms);
      EXPECT_EQ(joined(calibration), "");
      EXPECT_EQ(calibration.camera(), "main");
      EXPECT_EQ(calibration.bits(), 10);
    }
  }
}

TEST_F(CameraCalibrationTest, MonitorsMayDifferInBrightness) {
  Rig rig;
  rig.brightness = {1.0, 0.6};
  const v1::CameraCalibration calibration = calibrated(kS, rig);
  expect_curves(kS, calibration);
  expect_noise(kS, calibration);
  expect_fall_off(calibration);
  EXPECT_NEAR(calibration.white_ms(), kS.full_scale_exposure_ms, 0.02 * kS.full_scale_exposure_ms);
  EXPECT_EQ(joined(calibration), "");
}

TEST_F(CameraCalibrationTest, NamesAMonitorThatIsNotSeen) {
  Rig rig;
  rig.brightness = {1.0, 0.0};
  const v1::CameraCalibration calibration = calibrated(kLinear, rig);
  EXPECT_TRUE(warns_only(calibration, "does not see monitor \"monitor 1\"")) << joined(calibration);
  rig.brightness = {0.0};
  capture(kLinear, rig);
  EXPECT_TRUE(says(calibrate().status(), "sees no monitor")) << calibrate().status();
}

// The camera makes every frame equally bright, so the exposures carry no information.
TEST_F(CameraCalibrationTest, RefusesACameraThatExposesAsItLikes) {
  Rig rig;
  rig.meddle = [](Shot& shot) { shot.exposure_ms = kMaxExposure_ms / 16.0; };
  for (const SensorModel& sensor : {kLinear, kS}) {
    capture(sensor, rig);
    EXPECT_TRUE(says(calibrate().status(), "automatic exposure")) << calibrate().status();
  }
}

TEST_F(CameraCalibrationTest, NoticesAutomaticGain) {
  Rig by_picture, late, by_exposure;
  by_picture.meddle = [](Shot& shot) { shot.exposure_ms *= shot.mean > 0.4 ? 0.9 : 1.0; };
  // The gain needs the frames of one take to adapt.
  late.meddle = [](Shot& shot) { shot.exposure_ms *= shot.take == 0 ? 0.9 : 1.0; };
  by_exposure.meddle = [](Shot& shot) { shot.exposure_ms *= shot.exposure == 3 ? 1.1 : 1.0; };
  for (const Rig& rig : {by_picture, late, by_exposure}) {
    const v1::CameraCalibration calibration = calibrated(kS, rig);
    EXPECT_TRUE(warns(calibration, "automatic exposure or gain")) << joined(calibration);
  }
}

TEST_F(CameraCalibrationTest, NoticesAutomaticWhiteBalance) {
  Rig by_exposure, by_take;
  by_exposure.meddle = [](Shot& shot) {
    if (shot.exposure >= 4) shot.gains = {1.1, 1.0, 0.9};
  };
  by_take.meddle = [](Shot& shot) {
    if (shot.take == 1) shot.gains = {1.03, 1.0, 0.97};
  };
  for (const Rig& rig : {by_exposure, by_take}) {
    const v1::CameraCalibration calibration = calibrated(kS, rig);
    EXPECT_TRUE(warns(calibration, "automatic white balance")) << joined(calibration);
  }
}

TEST_F(CameraCalibrationTest, NoticesFlickerAndWhereItIsWorst) {
  Rig rig;
  rig.meddle = [](Shot& shot) {
    shot.exposure_ms *= 1.0 + (shot.exposure == 7 ? 0.06 : 0.01) * std::sin(2.4 * shot.step);
  };
  const v1::CameraCalibration calibration = calibrated(kS, rig);
  EXPECT_TRUE(warns(calibration, "flicker")) << joined(calibration);
  EXPECT_TRUE(warns(calibration, "most at 0.93")) << joined(calibration);
}

TEST_F(CameraCalibrationTest, NoticesClipping) {
  Rig rig;
  rig.exposures_ms = {40.0, 25.0, 15.0, 9.0};
  const v1::CameraCalibration clipped = calibrated(kS, rig);
  EXPECT_TRUE(warns_only(clipped, "is clipped in")) << joined(clipped);
  EXPECT_FALSE(clipped.has_fall_off());
  EXPECT_EQ(clipped.white_ms(), 0.0);
  rig.exposures_ms = {2.0, 1.2, 0.8};
  const v1::CameraCalibration dark = calibrated(kLinear, rig);
  EXPECT_TRUE(warns_only(dark, "nothing is bright enough")) << joined(dark);
  SensorModel sensor = kLinear;
  sensor.black_level = 0.0;
  const v1::CameraCalibration black = calibrated(sensor);
  EXPECT_TRUE(warns_only(black, "cuts off noise")) << joined(black);
}

TEST_F(CameraCalibrationTest, SaysWhatTheFramesLack) {
  Rig rig;
  rig.exposures_ms = {4.0};
  capture(kLinear, rig);
  EXPECT_TRUE(says(calibrate().status(), "1 exposure")) << calibrate().status();
  rig.exposures_ms = {40.0, 0.4};
  capture(kLinear, rig);
  EXPECT_TRUE(says(calibrate().status(), "add one between")) << calibrate().status();
}

}  // namespace
}  // namespace glasswing
