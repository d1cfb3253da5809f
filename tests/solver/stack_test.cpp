// Whole stacks of frames, good and bad, with a matte that is known.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "solver/bands.h"
#include "solver/gaussian/footprint.h"

namespace glasswing {
namespace {

constexpr int kWidth = 12, kHeight = 6;
constexpr MonitorExtent kMonitor{.width_px = 96.0, .height_px = 64.0};
constexpr double kNoise = 0.002, kForeground = 0.03;

// Frames of a small camera: left of the middle the object, right of it the bare monitor, dark.
class SimulatedStack {
 public:
  using Truth = Footprints (*)(int x, int y);

  explicit SimulatedStack(Truth truth, std::vector<double> exposures = {1.0}) : truth_(truth) {
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
        for (const double value : {0.0, 1.0}) {
          v1::Stimulus stimulus;
          stimulus.set_kind("solid");
          stimulus.set_panel("back");
          for (int c = 0; c < 3; ++c) stimulus.add_colour(value);
          add(stimulus, object, exposure);
        }
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
        }
      }
    }
  }

  v1::CaptureManifest& manifest() { return manifest_; }
  std::vector<std::uint16_t>& frame(int i) { return frames_[static_cast<size_t>(i)]; }
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
    FrameStack stack{
        .manifest = manifest_, .first_row = 0, .row_count = kHeight, .rows = {}, .owner = nullptr};
    for (const auto& frame : frames_) stack.rows.push_back(frame);
    return stack;
  }
  Matte solve() const { return solve_in_bands(*make_method("gaussian", {}).value(), stack(), 2).value(); }

 private:
  double radiance(const v1::Stimulus& stimulus, bool object, int x, int y) const {
    if (stimulus.kind() == "patch") return 0.0;
    if (!object) return stimulus.kind() == "solid" && stimulus.colour(0) > 0.0 && x >= kWidth / 2 ? 0.5 : 0.0;
    if (x >= kWidth / 2) return radiance(stimulus, false, x, y);
    double sum = kForeground;
    for (const Footprint& mode : truth_(x, y)) {
      if (stimulus.kind() == "solid") {
        sum += stimulus.colour(0) * mode.weight;
      } else {
        const double phi = stimulus.phi_deg() * M_PI / 180.0;
        const StripeAxis axis{.cos_phi = std::cos(phi), .sin_phi = std::sin(phi), .sigma_px = 4.0};
        sum += response(mode, axis, stimulus.r_px(), kMonitor);
      }
    }
    return sum;
  }
  void add(const v1::Stimulus& stimulus, bool object, double exposure) {
    v1::Frame& record = *manifest_.add_frames();
    record.set_file("frames/" + std::to_string(manifest_.frames_size()) + ".tif");
    record.set_object(object);
    record.set_exposure_ms(exposure);
    *record.mutable_stimulus() = stimulus;
    std::vector<std::uint16_t>& frame = frames_.emplace_back();
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double light = radiance(stimulus, object, x, y);
        for (int c = 0; c < 3; ++c) {
          const double value = exposure * light + noise_(random_);
          frame.push_back(static_cast<std::uint16_t>(std::lround(std::clamp(value, 0.0, 1.0) * 65535.0)));
        }
      }
    }
  }

  const Truth truth_;
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

// A bright view and a reflection a fortieth as bright.
Footprints bright_and_dim(int x, int y) {
  Footprints modes = one(x, y);
  modes[0].weight = 0.9;
  modes.push_back(
      {.weight = 0.022, .x_px = 70.0, .y_px = 20.0 + y, .xx_px2 = 3.0, .xy_px2 = 0.0, .yy_px2 = 3.0});
  return modes;
}

// Five of its own standard errors: one in a million of what is compared lies beyond.
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
      for (int i = 0; i < modes.size(); ++i) expect_mode(m.modes(x, y, c)[static_cast<size_t>(i)], modes[i]);
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

TEST(Stack, AMissingStepIsAnUnevenSweep) {
  SimulatedStack simulated(one);
  // Of the first sweep, the step before the middle of most crests; of the third, two in a row.
  simulated.remove(4 + 31);
  simulated.remove(4 + 69 + 70 + 40);
  simulated.remove(4 + 69 + 70 + 40);
  expect_truth(simulated.solve(), one);
}

TEST(Stack, BracketsHoldBrightAndDim) {
  expect_truth(SimulatedStack(bright_and_dim, {1.0, 16.0}).solve(), bright_and_dim);
}

// A rough surface: what it reflects is spread over much of the monitor, and its answer to a stripe is 2 % of
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
  // Read noise alone: 1 + 16 + 256 as much information. Each rms of 108 weights has an error of 1 /
  // sqrt(216).
  EXPECT_NEAR(gain_db, 10.0 * std::log10(273.0), 4.0 * 20.0 * std::log10(1.0 + std::sqrt(2.0 / 216.0)));
}

TEST(Stack, GainMakesBrightSamplesCountLess) {
  SimulatedStack simulated(one);
  // Its noise is even, whatever the manifest says: then the fit is not the best, but no worse than said.
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
  // The lowest row sees a cell; in every frame another id is shown.
  for (int i = 0; i < simulated.manifest().frames_size(); ++i) {
    const size_t row = static_cast<size_t>(kWidth) * 3;
    std::fill(simulated.frame(i).end() - static_cast<std::ptrdiff_t>(row), simulated.frame(i).end(), lit(i));
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
      EXPECT_EQ(matte.foreground(x, y)[static_cast<size_t>(c)], 0.0f);
    }
  });
}

TEST(Stack, AWidthThatIsALieIsRefused) {
  SimulatedStack simulated(one);
  simulated.manifest().mutable_camera()->set_width_px(kWidth + 1);
  const auto method = make_method("gaussian", {}).value();
  const absl::Status status = solve_in_bands(*method, simulated.stack(), 1).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_NE(std::string(status.message()).find("frames/"), std::string::npos) << status;
}

TEST(Stack, StopsWhenAsked) {
  const auto method = make_method("gaussian", {}).value();
  std::stop_source stop;
  stop.request_stop();
  const SimulatedStack simulated(one);
  EXPECT_TRUE(absl::IsCancelled(solve_in_bands(*method, simulated.stack(), 1, stop.get_token()).status()));
}

}  // namespace
}  // namespace glasswing
