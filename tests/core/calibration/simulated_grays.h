// An archive with the frames of a display calibration, from a simulated monitor and camera.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "core/calibration/display_calibration.h"
#include "core/frame/archive.h"
#include "core/pattern/calibration_steps.h"
#include "core/pattern/id_patch.h"
#include "core/pattern/pattern.h"
#include "core/sim/panel.h"
#include "core/sim/sensor.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {

inline constexpr MonitorSize kScreen{.width_px = 128, .height_px = 96};
inline constexpr int kPatchRows = 16, kLeft_px = 16,
                     kTop_px = 2;  // the screen's position in the camera's picture
inline constexpr int kWidth_px = 160, kHeight_px = 120;
inline constexpr double kGoal = 0.005;  // of full scale

// A monitor and a camera in front of it, pixel on pixel; below the screen its id patch, and below that a
// table that mirrors it.
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
  // Declared and actual exposure times.
  std::vector<std::pair<double, double>> exposures_ms{{4.0, 4.0}};
  int grays = 17, takes = 2;
  nanoseconds between = std::chrono::milliseconds(100);  // between frames
  float room = 0.0f;                                     // light mirrored by the screen
  bool calibrated = true;
  double curve_off = 0.0, waves = 0.5;  // the calibration adds curve_off sin(2 pi waves light)
  std::string response = "unknown";
  // Disturbances of the light or the frame.
  std::function<void(v1::Frame&, RadianceImage&)> disturb = [](v1::Frame&, RadianceImage&) {};

  double share_of(double code) const { return tone ? tone(code) : std::pow(code, panel.gamma); }
};

// The linear value of a code, by inverting the sensor's curve.
inline double linear_of(const SensorCurve& curve, double code) {
  double low = 0.0, high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high), u = std::pow(middle, curve.exponent);
    const double made = (1.0 - curve.contrast) * u + curve.contrast * (3.0 * u * u - 2.0 * u * u * u);
    (made < code ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

inline constexpr double kSaturation = 0.99;
// Light is on the scale where code kSaturation is 1.
inline double light_of_code(const SensorModel& sensor, double code) {
  const auto above = [&](double z) { return linear_of(sensor.curve, z) - sensor.black_level; };
  return above(code) / above(kSaturation);
}
// The light of a value of sensor.h.
inline double light_of_value(const SensorModel& sensor, double value) {
  return (1.0 - sensor.black_level) * value / (linear_of(sensor.curve, kSaturation) - sensor.black_level);
}

inline v1::CameraCalibration camera_calibration(const Rig& rig) {
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

inline v1::Monitor monitor_of(const Rig& rig) {
  v1::Monitor monitor;
  monitor.set_name("back");
  monitor.set_width_px(kScreen.width_px);
  monitor.set_height_px(kScreen.height_px);
  monitor.set_patch_rows(kPatchRows);
  monitor.set_bits(rig.bits);
  return monitor;
}

inline v1::CaptureManifest header_of(const Rig& rig) {
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

// The picture of the screen and the strip below it.
inline RadianceImage emitted(const Rig& rig, const v1::Stimulus& stimulus, int id, nanoseconds lit) {
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

inline RadianceImage seen(const Rig& rig, const RadianceImage& monitor) {
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

class SimulatedGrays : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove_all(directory_); }

  std::shared_ptr<const MappedArchive> captured(
      const Rig& rig, const std::function<void(v1::CaptureManifest&)>& change = [](v1::CaptureManifest&) {}) {
    std::filesystem::remove_all(directory_);
    v1::CaptureManifest header = header_of(rig);
    change(header);
    const auto archive = Archive::create(directory_, header).value();
    std::vector<Archive::NewFrame> frames;
    const auto stimuli = calibration_stimuli(header.plan().calibration(), header.monitors(0));
    for (int i = 0; i < static_cast<int>(stimuli.size()); ++i) {
      for (const auto& [declared_ms, real_ms] : rig.exposures_ms) {
        const int step = static_cast<int>(frames.size());
        v1::Frame record;
        *record.mutable_stimulus() = stimuli[i];
        record.set_step(step);
        record.set_exposure_ms(declared_ms);
        record.set_exposure_start_ns((1 + step) * rig.between.count());
        RadianceImage light = seen(rig, emitted(rig, record.stimulus(), i, step * rig.between));
        rig.disturb(record, light);
        if (record.stimulus().kind().empty()) continue;  // lost
        frames.push_back({.record = record, .image = expose(light, real_ms, rig.sensor, step)});
      }
    }
    EXPECT_OK(archive->add(frames));
    EXPECT_OK(archive->seal());
    return MappedArchive::open(directory_).value();
  }
  v1::DisplayCalibration calibrated(const Rig& rig) {
    return calibrate_displays(*captured(rig)).value().measured.at(0);
  }
  std::string refusal(const Rig& rig) {
    const absl::Status status = calibrate_displays(*captured(rig)).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    return std::string(status.message());
  }

  const TemporaryDirectory directory_;
};

inline double worst_curve_error(const v1::DisplayCalibration& calibration, const Rig& rig,
                                double up_to = 1.0) {
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

inline void says(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}
// Expects exactly one warning, which contains the text.
inline void warns(const v1::DisplayCalibration& calibration, const std::string& part) {
  ASSERT_EQ(calibration.warnings_size(), 1) << fmt::format("{}", fmt::join(calibration.warnings(), "; "));
  says(calibration.warnings(0), part);
}

}  // namespace glasswing
