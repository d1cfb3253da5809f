// Whole stacks of frames, valid and invalid, with a known matte.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/footprint/footprint.h"
#include "solver/method/brightness_drift.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"

namespace glasswing {
namespace {

constexpr int kWidth = 12, kHeight = 6;
constexpr MonitorExtent kMonitor{.width_px = 96.0, .height_px = 64.0};
constexpr double kNoise = 0.002, kForeground = 0.03;

// The share of a footprint that lies on the monitor, by a sum over its pixels; for wide ones.
double on_monitor(const Footprint& mode) {
  const double determinant = mode.xx_px2 * mode.yy_px2 - mode.xy_px2 * mode.xy_px2;
  double sum = 0.0;
  for (int y = 0; y < static_cast<int>(kMonitor.height_px); ++y) {
    for (int x = 0; x < static_cast<int>(kMonitor.width_px); ++x) {
      const double dx = x + 0.5 - mode.x_px, dy = y + 0.5 - mode.y_px;
      sum += std::exp(-0.5 * (mode.yy_px2 * dx * dx - 2.0 * mode.xy_px2 * dx * dy + mode.xx_px2 * dy * dy) /
                      determinant);
    }
  }
  return sum / (2.0 * M_PI * std::sqrt(determinant));
}

// Frames of a small camera: the object left of the middle, the bare, dark monitor right of it.
class SimulatedStack {
 public:
  using Truth = Footprints (*)(int x, int y);

  // `fade`: the share of its light that the monitor loses, linearly in time, from the first white with the
  // object to the end. `foreground`: F.
  explicit SimulatedStack(Truth truth, std::vector<double> exposures = {1.0}, int white_every = 0,
                          double fade = 0.0, double foreground = kForeground)
      : truth_(truth), fade_(fade), foreground_(foreground) {
    v1::Camera& camera = *manifest_.mutable_camera();
    camera.set_width_px(kWidth);
    camera.set_height_px(kHeight);
    camera.set_read_sd(kNoise);
    v1::Monitor& monitor = *manifest_.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(static_cast<int>(kMonitor.width_px));
    monitor.set_height_px(static_cast<int>(kMonitor.height_px));
    for (const double exposure : exposures) {
      for (const bool object : {true, false}) {
        for (const double value : {0.0, 1.0}) add_solid(value, object, exposure);
      }
      for (const double degrees : {0.0, 90.0, 45.0, -45.0}) {
        for (double r = degrees < 0.0 ? -54.0 : -12.0; r <= 126.0; r += 2.0) {
          v1::Stimulus stimulus;
          stimulus.set_kind("gauss_stripe");
          stimulus.set_panel("back");
          stimulus.set_phi_deg(degrees);
          stimulus.set_r_px(r);
          stimulus.set_sigma_px(4.0);
          stimulus.set_peak(1.0);
          add(stimulus, true, exposure);
          if (white_every == 0 || manifest_.frames_size() % white_every != 0) continue;
          for (const double value : {0.0, 1.0}) add_solid(value, true, exposure);
        }
      }
    }
  }

  v1::CaptureManifest& manifest() { return manifest_; }
  const v1::CaptureManifest& manifest() const { return manifest_; }
  std::vector<std::uint16_t>& frame(int i) { return frames_[i]; }
  void remove(int i) {
    manifest_.mutable_frames()->DeleteSubrange(i, 1);
    frames_.erase(frames_.begin() + i);
  }
  void add_patch(std::uint32_t id) {
    v1::Stimulus stimulus;
    stimulus.set_kind("patch");
    stimulus.set_panel("back");
    stimulus.set_patch_id(id);
    add(stimulus, false, 1.0);
  }
  FrameStack stack() const {
    FrameStack stack{.width_px = manifest_.camera().width_px(),
                     .first_row = 0,
                     .row_count = kHeight,
                     .rows = {},
                     .owner = nullptr};
    for (const auto& frame : frames_) stack.rows.push_back(frame);
    return stack;
  }
  absl::StatusOr<std::vector<std::array<float, 3>>> drift() const {
    return measure_brightness_drift(manifest_, [this](int row, const std::vector<int>& frames) {
      constexpr std::ptrdiff_t kRow = kWidth * 3;
      std::vector<std::uint16_t> samples;
      for (const int frame : frames) {
        const auto first = frames_[frame].begin() + row * kRow;
        samples.insert(samples.end(), first, first + kRow);
      }
      return absl::StatusOr<std::vector<std::uint16_t>>(samples);
    });
  }
  Matte solve() const {
    return solve_in_bands(*make_method("gaussian", {}).value(), manifest_, stack(), 2).value();
  }

 private:
  double radiance(const v1::Stimulus& stimulus, bool object, int x, int y) const {
    if (stimulus.kind() == "patch") return 0.0;
    if (!object) return stimulus.kind() == "solid" && stimulus.colour(0) > 0.0 && x >= kWidth / 2 ? 0.5 : 0.0;
    if (x >= kWidth / 2) return radiance(stimulus, false, x, y);
    double sum = foreground_;
    for (const Footprint& mode : truth_(x, y)) {
      if (stimulus.kind() == "solid") {
        sum += stimulus.colour(0) * mode.weight * on_monitor(mode);
      } else {
        const double phi = stimulus.phi_deg() * M_PI / 180.0;
        const StripeAxis axis{.cos_phi = std::cos(phi), .sin_phi = std::sin(phi), .sigma_px = 4.0};
        sum += response(mode, axis, stimulus.r_px(), kMonitor);
      }
    }
    return sum;
  }
  void add_solid(double value, bool object, double exposure) {
    v1::Stimulus stimulus;
    stimulus.set_kind("solid");
    stimulus.set_panel("back");
    for (int c = 0; c < 3; ++c) stimulus.add_colour(value);
    add(stimulus, object, exposure);
  }
  void add(const v1::Stimulus& stimulus, bool object, double exposure) {
    v1::Frame& record = *manifest_.add_frames();
    record.set_file("frames/" + std::to_string(manifest_.frames_size()) + ".tif");
    record.set_object(object);
    record.set_exposure_ms(exposure);
    record.set_exposure_start_ns(manifest_.frames_size() * 1'000'000'000LL);
    const double brightness =
        1.0 - fade_ * (manifest_.frames_size() - 2) / 300.0;  // the first white is the second frame
    *record.mutable_stimulus() = stimulus;
    std::vector<std::uint16_t>& frame = frames_.emplace_back();
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double dark = object && x < kWidth / 2 ? foreground_ : 0.0;
        const double light = dark + (radiance(stimulus, object, x, y) - dark) * brightness;
        for (int c = 0; c < 3; ++c) {
          const double value = exposure * light + noise_(random_);
          frame.push_back(static_cast<std::uint16_t>(std::lround(std::clamp(value, 0.0, 1.0) * 65535.0)));
        }
      }
    }
  }

  const Truth truth_;
  const double fade_, foreground_;
  std::mt19937 random_{5};
  std::normal_distribution<double> noise_{0.0, kNoise};
  v1::CaptureManifest manifest_;
  std::vector<std::vector<std::uint16_t>> frames_;
};

Footprints one(int x, int y) {
  Footprints modes;
  modes.push_back({.weight = 0.6,
                   .x_px = 40.0 + 2.0 * x,
                   .y_px = 25.0 + 2.0 * y,
                   .xx_px2 = 6.0,
                   .xy_px2 = 1.0,
                   .yy_px2 = 4.0});
  return modes;
}

// A bright view and a reflection with a fortieth of its light.
Footprints bright_and_dim(int x, int y) {
  Footprints modes = one(x, y);
  modes[0].weight = 0.9;
  modes.push_back(
      {.weight = 0.022, .x_px = 70.0, .y_px = 20.0 + y, .xx_px2 = 3.0, .xy_px2 = 0.0, .yy_px2 = 3.0});
  return modes;
}

// A view through glass that is frosted a little: a third of the light comes from all over the monitor.
Footprints frosted(int x, int y) {
  Footprints modes = one(x, y);
  modes.push_back(
      {.weight = 0.3, .x_px = 50.0, .y_px = 30.0 + y, .xx_px2 = 900.0, .xy_px2 = 0.0, .yy_px2 = 700.0});
  return modes;
}

// Five standard errors: one comparison in a million lies beyond.
void expect_mode(const Mode& found, const Footprint& truth) {
  EXPECT_NEAR(static_cast<double>(found.weight), truth.weight, 5.0 * static_cast<double>(found.weight_sd));
  const double reach = 5.0 * static_cast<double>(found.centre_sd_px);
  EXPECT_NEAR(static_cast<double>(found.x_px), truth.x_px, reach);
  EXPECT_NEAR(static_cast<double>(found.y_px), truth.y_px, reach);
  EXPECT_GT(found.weight_sd, 0.0f);
  EXPECT_LT(reach, 2.0);
}

template <typename Check>
void for_object(const Matte& matte, Check check) {
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) check(x, y, matte);
  }
}

void expect_truth(const Matte& matte, SimulatedStack::Truth truth) {
  for_object(matte, [&](int x, int y, const Matte& m) {
    EXPECT_EQ(m.flags(x, y), 0) << x << " " << y;
    EXPECT_EQ(m.coverage(x, y), 1.0f);
    for (int c = 0; c < kChannels; ++c) {
      const Footprints modes = truth(x, y);
      for (int i = 0; i < modes.size(); ++i) expect_mode(m.modes(x, y, c)[i], modes[i]);
    }
  });
}

TEST(Stack, GivesBackTheMatte) {
  const Matte matte = SimulatedStack(one).solve();
  expect_truth(matte, one);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = kWidth / 2; x < kWidth; ++x) EXPECT_EQ(matte.coverage(x, y), 0.0f) << x << " " << y;
  }
}

// Stripes make no peak of such light. White shows it, with its own noise and that of black.
TEST(Stack, LightFromAllOverTheMonitorIsKept) {
  const Matte matte = SimulatedStack(frosted).solve();
  for_object(matte, [&](int x, int y, const Matte& m) {
    const Footprints truth = frosted(x, y);
    double white = 0.0;
    for (const Footprint& mode : truth) white += mode.weight * on_monitor(mode);
    EXPECT_EQ(m.flags(x, y), 0) << x << " " << y;
    for (int c = 0; c < kChannels; ++c) {
      expect_mode(m.modes(x, y, c)[0], truth[0]);
      double found = 0.0;
      for (const Mode& mode : m.modes(x, y, c)) {
        if (mode.weight <= 0.0f) continue;
        found += static_cast<double>(mode.weight) * on_monitor({.weight = 1.0,
                                                                .x_px = static_cast<double>(mode.x_px),
                                                                .y_px = static_cast<double>(mode.y_px),
                                                                .xx_px2 = static_cast<double>(mode.xx_px2),
                                                                .xy_px2 = static_cast<double>(mode.xy_px2),
                                                                .yy_px2 = static_cast<double>(mode.yy_px2)});
      }
      EXPECT_NEAR(found, white, 5.0 * std::sqrt(2.0) * kNoise) << x << " " << y << " " << c;
      EXPECT_NEAR(m.foreground(x, y)[c], kForeground, 5.0 * kNoise);
    }
  });
}

// White says so if the modes that were allowed do not hold all light.
TEST(Stack, LightThatModesCannotHoldIsFlagged) {
  SimulatedStack simulated(frosted);
  const Matte matte = solve_in_bands(*make_method("gaussian", {{"modes", "1"}}).value(), simulated.manifest(),
                                     simulated.stack())
                          .value();
  for_object(matte, [&](int x, int y, const Matte& m) {
    EXPECT_NE(m.flags(x, y) & kFlagPoorFit, 0) << x << " " << y;
    EXPECT_EQ(m.modes_per_channel(), 1);
  });
}

// Noise that is cut off at black is neither light nor less noise. The foreground is black here.
Footprints dim(int x, int y) {
  Footprints modes = one(x, y);
  modes[0].weight = 0.2;
  return modes;
}
TEST(Stack, NoiseBelowBlackIsNoLight) {
  SimulatedStack simulated(dim, {1.0}, 0, 0.0, 0.0);
  simulated.manifest().mutable_camera()->clear_read_sd();
  const Matte matte = simulated.solve();
  double foreground = 0.0, weight = 0.0, count = 0.0;
  for_object(matte, [&](int x, int y, const Matte& m) {
    EXPECT_EQ(m.flags(x, y), 0) << x << " " << y;
    for (int c = 0; c < kChannels; ++c) {
      expect_mode(m.modes(x, y, c)[0], dim(x, y)[0]);
      foreground += static_cast<double>(m.foreground(x, y)[c]);
      weight += static_cast<double>(m.modes(x, y, c)[0].weight);
      count += 1.0;
    }
  });
  // Some hundred lanes of some hundred dark samples; zeros alone would make it 0.4 of the noise.
  EXPECT_NEAR(foreground / count, 0.0, 0.1 * kNoise);
  EXPECT_NEAR(weight / count, 0.2, 0.5 * kNoise);
}

TEST(Stack, WithoutOrientationWidthsAlongTheAxesStay) {
  SimulatedStack simulated(one);
  const Matte oriented = simulated.solve();
  const Matte upright = solve_in_bands(*make_method("gaussian", {{"oriented", "0"}}).value(),
                                       simulated.manifest(), simulated.stack())
                            .value();
  // Of a covariance by core/matte/matte_rounding, which looks at both axes.
  const auto rounding = [](float variance_px2) {
    const double seen_px = std::sqrt(variance_px2 + 1.0 / 12.0);
    return std::max(seen_px * seen_px / 1024.0, seen_px / 512.0);
  };
  for_object(upright, [&](int x, int y, const Matte& m) {
    for (int c = 0; c < kChannels; ++c) {
      const Mode &a = oriented.modes(x, y, c)[0], &b = m.modes(x, y, c)[0];
      EXPECT_NE(a.xy_px2, 0.0f);
      EXPECT_EQ(b.xy_px2, 0.0f);
      EXPECT_NEAR(a.xx_px2, b.xx_px2, rounding(b.xx_px2));
      EXPECT_NEAR(a.yy_px2, b.yy_px2, rounding(b.yy_px2));
      EXPECT_EQ(a.weight, b.weight);
    }
  });
}

TEST(Stack, AMissingStepIsAnUnevenSweep) {
  SimulatedStack simulated(one);
  // In the first sweep, the step before the middle of most peaks; in the third, two in a row.
  simulated.remove(4 + 31);
  simulated.remove(4 + 69 + 70 + 40);
  simulated.remove(4 + 69 + 70 + 40);
  expect_truth(simulated.solve(), one);
}

TEST(Stack, BracketsHoldBrightAndDim) {
  expect_truth(SimulatedStack(bright_and_dim, {1.0, 16.0}).solve(), bright_and_dim);
}

// A rough surface: its reflection is spread over much of the monitor, and its response to a stripe is 2 % of
// full scale.
Footprints rough(int x, int y) {
  Footprints modes;
  modes.push_back(
      {.weight = 0.05, .x_px = 44.0 + x, .y_px = 30.0 + y, .xx_px2 = 64.0, .xy_px2 = 0.0, .yy_px2 = 64.0});
  return modes;
}

double weight_rms(const Matte& matte, SimulatedStack::Truth truth) {
  double squares = 0.0, count = 0.0;
  for_object(matte, [&](int x, int y, const Matte& m) {
    for (int c = 0; c < kChannels; ++c, ++count)
      squares += std::pow(static_cast<double>(m.modes(x, y, c)[0].weight) - truth(x, y)[0].weight, 2);
  });
  return std::sqrt(squares / count);
}

TEST(Stack, BracketsGiveDimSurfacesTheSignalThatTheNoiseModelPromises) {
  const double single = weight_rms(SimulatedStack(rough).solve(), rough),
               bracket = weight_rms(SimulatedStack(rough, {1.0, 4.0, 16.0}).solve(), rough);
  const double gain_db = 20.0 * std::log10(single / bracket);
  std::printf("rough surface: weight off by %.2f %% rms at 1x, %.3f %% with 1x, 4x and 16x: %.1f dB less\n",
              100.0 * single / 0.05, 100.0 * bracket / 0.05, gain_db);
  // Read noise only: 1 + 16 + 256 times the information. Each rms of 108 weights has an error of 1 /
  // sqrt(216).
  EXPECT_NEAR(gain_db, 10.0 * std::log10(273.0), 4.0 * 20.0 * std::log10(1.0 + std::sqrt(2.0 / 216.0)));
}

TEST(Stack, AMonitorThatFadesBiasesWeightsUnlessWhiteIsShownAgain) {
  SimulatedStack simulated(one, {1.0}, 25, 0.06);
  const auto mean_weight = [](const Matte& matte) {
    double sum = 0.0;
    for_object(matte, [&](int x, int y, const Matte& m) {
      for (int c = 0; c < kChannels; ++c)
        sum += static_cast<double>(m.modes(x, y, c)[0].weight) / (kChannels * kHeight * kWidth / 2);
    });
    return sum;
  };
  // Halfway on average.
  EXPECT_NEAR(mean_weight(simulated.solve()) / 0.6, 0.97, 0.01);
  FrameStack stack = simulated.stack();
  stack.brightness = simulated.drift().value();
  for (size_t i = 1; i < stack.brightness.size(); ++i) {
    // Sums over 216 samples of about 0.5 with a noise of 0.002, twice and over two frames each: 0.0005.
    if (simulated.manifest().frames(static_cast<int>(i)).object()) {
      EXPECT_NEAR(static_cast<double>(stack.brightness[i][0]),
                  1.0 - 0.06 * (static_cast<double>(i) - 1.0) / 300.0, 5.0 * 0.0005);
    }
  }
  const Matte matte =
      solve_in_bands(*make_method("gaussian", {}).value(), simulated.manifest(), stack, 2).value();
  expect_truth(matte, one);
  EXPECT_NEAR(mean_weight(matte) / 0.6, 1.0, 5.0 * 0.0005);
}

TEST(Stack, DriftNeedsRepeatsAndHasBounds) {
  EXPECT_TRUE(SimulatedStack(one).drift().value().empty());
  EXPECT_TRUE(SimulatedStack(one, {1.0, 4.0}).drift().value().empty());
  const absl::Status status = SimulatedStack(one, {1.0}, 25, 0.4).drift().status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_NE(std::string(status.message()).find("\"back\" changed by"), std::string::npos) << status;
}

TEST(Stack, FallOffIsTakenOutOfTheMatte) {
  const SimulatedStack plain(one);
  const Matte even = plain.solve();
  SimulatedStack simulated(one);
  v1::CameraCalibration& calibration = *simulated.manifest().mutable_camera_calibration();
  calibration.set_format_version(1);
  calibration.set_saturation(1.0);
  calibration.set_read_sd(kNoise);
  for (int c = 0; c < 3; ++c) {
    v1::CameraCurve& curve = *calibration.add_curves();
    curve.add_light(0.0f);
    curve.add_light(1.0f);
  }
  calibration.mutable_fall_off()->set_r2(-0.2);
  v1::DisplayCalibration& display = *simulated.manifest().add_display_calibrations();
  display.set_monitor("back");
  display.mutable_uniformity()->set_columns(1);
  display.mutable_uniformity()->set_rows(1);
  display.mutable_uniformity()->add_light(0.8f);
  const Matte matte = simulated.solve();
  EXPECT_TRUE(matte.metadata.linearised());
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double across = x + 0.5 - kWidth / 2.0, down = y + 0.5 - kHeight / 2.0;
      const double left =
          1.0 - 0.2 * (across * across + down * down) / (0.25 * (kWidth * kWidth + kHeight * kHeight));
      const Mode &flat = matte.modes(x, y, 1)[0], &seen = even.modes(x, y, 1)[0];
      // A step of 16 bits more or less in every sample.
      EXPECT_NEAR(static_cast<double>(flat.weight) * left * 0.8, static_cast<double>(seen.weight), 1e-4);
      EXPECT_NEAR(static_cast<double>(matte.foreground(x, y)[1]) * left,
                  static_cast<double>(even.foreground(x, y)[1]), 1e-4);
    }
  }
  calibration.mutable_fall_off()->set_r4(-0.8);
  const auto method = make_method("gaussian", {}).value();
  const absl::Status status = solve_in_bands(*method, simulated.manifest(), simulated.stack(), 1).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_NE(std::string(status.message()).find("fall-off"), std::string::npos) << status;
}

TEST(Stack, GainMakesBrightSamplesCountLess) {
  SimulatedStack simulated(one);
  // The noise is uniform, unlike the manifest's: the fit is not optimal, but within its standard errors.
  simulated.manifest().mutable_camera()->set_gain(1e-5);
  expect_truth(simulated.solve(), one);
}

TEST(Stack, GainAloneLeavesTheReadNoiseToBeMeasured) {
  SimulatedStack simulated(one);
  simulated.manifest().mutable_camera()->set_read_sd(0.0);
  simulated.manifest().mutable_camera()->set_gain(1e-5);
  expect_truth(simulated.solve(), one);
}

TEST(Stack, PixelsThatSeeAnIdPatchAreFlaggedAndOthersAreNot) {
  SimulatedStack simulated(one);
  const auto lit = [](int frame) { return static_cast<std::uint16_t>(frame % 3 == 0 ? 30000 : 200); };
  const int before = simulated.manifest().frames_size();
  for (const std::uint32_t id : {0x0000u, 0xffffu, 0xaaaau}) simulated.add_patch(id);
  // The lowest row sees a cell; every frame shows another id.
  for (int i = 0; i < simulated.manifest().frames_size(); ++i) {
    const size_t row = static_cast<size_t>(kWidth) * 3;
    std::fill(simulated.frame(i).end() - row, simulated.frame(i).end(), lit(i));
  }
  ASSERT_GE(simulated.manifest().frames_size(), before + 3);
  const Matte matte = simulated.solve();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool patch = y == kHeight - 1;
      EXPECT_EQ(matte.flags(x, y), patch ? kFlagNoData : kFlagNone) << x << " " << y;
      EXPECT_EQ(matte.coverage(x, y), !patch && x < kWidth / 2 ? 1.0f : 0.0f) << x << " " << y;
      if (!patch) continue;
      EXPECT_EQ(matte.modes(x, y, 0)[0].weight, 0.0f);
      EXPECT_EQ(matte.foreground(x, y)[0], 0.0f);
    }
  }
}

TEST(Stack, SaturatedEverywhereIsFlagged) {
  SimulatedStack simulated(one);
  for (int i = 0; i < simulated.manifest().frames_size(); ++i)
    std::fill(simulated.frame(i).begin(), simulated.frame(i).end(), 65535);
  for_object(simulated.solve(), [](int x, int y, const Matte& matte) {
    EXPECT_EQ(matte.flags(x, y) & (kFlagSaturated | kFlagNoData), kFlagSaturated | kFlagNoData);
    for (int c = 0; c < kChannels; ++c) EXPECT_EQ(matte.modes(x, y, c)[0].weight, 0.0f);
  });
}

TEST(Stack, AllBlackTransmitsNothing) {
  SimulatedStack simulated(one);
  for (int i = 0; i < simulated.manifest().frames_size(); ++i) {
    if (simulated.manifest().frames(i).object())
      std::fill(simulated.frame(i).begin(), simulated.frame(i).end(), 0);
  }
  for_object(simulated.solve(), [](int x, int y, const Matte& matte) {
    for (int c = 0; c < kChannels; ++c) {
      EXPECT_EQ(matte.modes(x, y, c)[0].weight, 0.0f);
      EXPECT_EQ(matte.foreground(x, y)[c], 0.0f);
    }
  });
}

TEST(Stack, AWidthThatIsALieIsRefused) {
  SimulatedStack simulated(one);
  simulated.manifest().mutable_camera()->set_width_px(kWidth + 1);
  const auto method = make_method("gaussian", {}).value();
  const absl::Status status = solve_in_bands(*method, simulated.manifest(), simulated.stack(), 1).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_NE(std::string(status.message()).find("frames/"), std::string::npos) << status;
}

TEST(Stack, StopsWhenAsked) {
  const auto method = make_method("gaussian", {}).value();
  std::stop_source stop;
  stop.request_stop();
  const SimulatedStack simulated(one);
  EXPECT_TRUE(absl::IsCancelled(
      solve_in_bands(*method, simulated.manifest(), simulated.stack(), 1, stop.get_token()).status()));
}

}  // namespace
}  // namespace glasswing
