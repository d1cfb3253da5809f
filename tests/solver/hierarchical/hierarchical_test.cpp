// Whole stacks of frames, valid and invalid, solved by `hierarchical` and `alpha`, with a known matte.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "core/composite/compositor.h"
#include "core/composite/summed_area_table.h"
#include "core/pattern/pattern.h"
#include "solver/hierarchical/wave_axis.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/solver/stack_of.h"

namespace glasswing {
namespace {

constexpr int kWidth = 24, kHeight = 8;  // camera and, twice as large, monitor
constexpr MonitorSize kMonitor{.width_px = 2 * kWidth, .height_px = 2 * kHeight};
constexpr double kNoise = 0.002;
constexpr double kForeground = 0.04, kRoom = 0.01;  // of the object, and of the background

const std::vector<BarWave> kHalves{{32.0}, {16.0}, {8.0}, {4.0}, {2.0}, {1.0}};
const std::vector<BarWave> kGrayCode{{64.0, 32.0}, {32.0, 16.0}, {16.0, 8.0},
                                     {8.0, 4.0},   {4.0, 2.0},   {2.0, 1.0}};

struct Capture {
  bool solids = true, complements = true, gray_code = false, empty_stage = true, noise_model = true;
  int first_level = 0;
  double light = 1.0;                  // more saturates
  std::vector<double> exposures{1.0};  // ms
};

// Left of the middle the object: each pixel sees its own box. Right of it the bare monitor, straight behind.
Mode truth(int x, int y, bool object) {
  Mode mode{.weight = 0.8f};
  if (!object || x >= kWidth / 2) {
    mode.x_px = static_cast<float>(2 * x + 1);
    mode.y_px = static_cast<float>(2 * y + 1);
    mode.xx_px2 = mode.yy_px2 = 4.0f / 12.0f;
    return mode;
  }
  const double width_px = 1.0 + 0.5 * x, height_px = 1.5 + 0.5 * y;
  mode.x_px = static_cast<float>(40.0 - 2.5 * x);
  mode.y_px = static_cast<float>(3.0 + 1.25 * y);
  mode.xx_px2 = static_cast<float>(width_px * width_px / 12.0);
  mode.yy_px2 = static_cast<float>(height_px * height_px / 12.0);
  return mode;
}

class SimulatedStack {
 public:
  explicit SimulatedStack(const Capture& capture) : capture_(capture) {
    v1::Camera& camera = *manifest_.mutable_camera();
    camera.set_width_px(kWidth);
    camera.set_height_px(kHeight);
    if (capture.noise_model) camera.set_read_sd(kNoise);
    v1::Monitor& monitor = *manifest_.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(kMonitor.width_px);
    monitor.set_height_px(kMonitor.height_px);
    for (const bool object : {true, false}) {
      if (!object && !capture.empty_stage) continue;
      if (capture.solids) {
        add_solid(object, {0, 0, 0});
        add_solid(object, {1, 1, 1});
      }
      for (const char* orient : {"vertical_bars", "horizontal_bars"}) {
        for (int level = capture.first_level; level < 6; ++level) {
          v1::Stimulus wave;
          wave.set_kind("square");
          wave.set_panel("back");
          wave.set_orient(orient);
          wave.set_bar_width_px(std::exp2(5 - level));
          // Bit b of a Gray code: bars of 2^(b + 1) px from 2^b on.
          if (capture.gray_code) {
            wave.set_bar_width_px(std::exp2(6 - level));
            wave.set_offset_px(std::exp2(5 - level));
          }
          add(object, wave);
          wave.set_inverse(true);
          if (capture.complements) add(object, wave);
        }
      }
    }
  }

  v1::CaptureManifest& manifest() { return manifest_; }
  void add_solid(bool object, const std::array<double, 3>& colour) {
    v1::Stimulus solid;
    solid.set_kind("solid");
    solid.set_panel("back");
    for (const double value : colour) solid.add_colour(value);
    add(object, solid);
  }
  void remove(const std::function<bool(const v1::Frame&)>& unwanted) {
    for (int i = manifest_.frames_size() - 1; i >= 0; --i) {
      if (!unwanted(manifest_.frames(i))) continue;
      manifest_.mutable_frames()->DeleteSubrange(i, 1);
      frames_.erase(frames_.begin() + i);
    }
  }
  FrameStack stack() const { return stack_of(manifest_, frames_); }
  absl::StatusOr<Matte> solve(const std::string& method = "hierarchical",
                              const MethodOptions& options = {}) const {
    const auto made = make_method(method, options);
    if (!made.ok()) return made.status();
    return solve_in_bands(**made, manifest_, stack(), 2);
  }

 private:
  void add(bool object, const v1::Stimulus& stimulus) {
    const RadianceImage shown = Pattern::create(stimulus, kMonitor)->rasterised();
    const SummedAreaTable summed(shown);
    for (const double exposure : capture_.exposures) {
      v1::Frame& record = *manifest_.add_frames();
      record.set_file("frames/" + std::to_string(manifest_.frames_size()) + ".tif");
      record.set_object(object);
      record.set_exposure_ms(exposure);
      *record.mutable_stimulus() = stimulus;
      Image16& frame = frames_.emplace_back(kWidth, kHeight);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          const Mode mode = truth(x, y, object);
          for (int c = 0; c < kChannels; ++c) {
            const double own = object && x < kWidth / 2 ? kForeground : kRoom;
            const double light = own + static_cast<double>(mode.weight) * summed.mean(mode, c);
            const double seen = std::clamp(capture_.light * exposure * light + noise_(random_), 0.0, 1.0);
            frame.at(x, y, c) = static_cast<std::uint16_t>(std::lround(seen * 65535.0));
          }
        }
      }
    }
  }

  const Capture capture_;
  std::mt19937 random_{5};
  std::normal_distribution<double> noise_{0.0, kNoise};
  v1::CaptureManifest manifest_;
  std::vector<Image16> frames_;
};

Interval side_of(float centre_px, float variance_px2) {
  const double half_px = 0.5 * std::sqrt(12.0 * static_cast<double>(variance_px2));
  return {.low_px = static_cast<double>(centre_px) - half_px,
          .high_px = static_cast<double>(centre_px) + half_px};
}

// Bars that share edges make some boxes indistinguishable, so the test compares the waves as seen by the
// result and by the truth. The best fit is no further from the samples than the truth is, so it is within
// twice the total noise of the truth: sqrt(K) of one of K waves, plus six as a margin.
void expect_side(const std::vector<BarWave>& waves, int extent_px, const Interval& found,
                 const Interval& truth) {
  const WaveAxis axis(waves, extent_px);
  std::vector<double> seen(waves.size()), expected(waves.size());
  axis.means(found, seen);
  axis.means(truth, expected);
  const double noise = 2.0 * kNoise / 0.8;  // of v, from one picture and weight 0.8
  for (size_t k = 0; k < waves.size(); ++k)
    EXPECT_NEAR(seen[k], expected[k], 2.0 * noise * (std::sqrt(static_cast<double>(waves.size())) + 6.0))
        << k;
  EXPECT_NEAR(found.centre_px(), truth.centre_px(), 0.5 * std::max(truth.length_px(), found.length_px()));
}

void expect_truth(const Matte& matte, const std::vector<BarWave>& waves = kHalves) {
  EXPECT_EQ(matte.metadata.footprint(), "box");
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      SCOPED_TRACE(testing::Message() << "pixel " << x << ", " << y);
      const Mode expected = truth(x, y, true);
      EXPECT_EQ(matte.coverage(x, y), 1.0f);
      EXPECT_EQ(matte.flags(x, y), kFlagNone);
      const Mode& mode = matte.modes(x, y, 1)[0];
      EXPECT_NEAR(mode.weight, expected.weight, 6.0 * static_cast<double>(mode.weight_sd));
      EXPECT_EQ(mode.xy_px2, 0.0f);
      expect_side(waves, kMonitor.width_px, side_of(mode.x_px, mode.xx_px2),
                  side_of(expected.x_px, expected.xx_px2));
      expect_side(waves, kMonitor.height_px, side_of(mode.y_px, mode.yy_px2),
                  side_of(expected.y_px, expected.yy_px2));
    }
  }
}

TEST(Hierarchical, FindsEveryPixelsBox) {
  const Matte matte = SimulatedStack({}).solve().value();
  expect_truth(matte);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = kWidth / 2; x < kWidth; ++x) {
      EXPECT_EQ(matte.coverage(x, y), 0.0f);
      EXPECT_NEAR(matte.modes(x, y, 0)[0].x_px, 2.0 * x + 1.0,
                  0.5);  // the background map, within the finest bar
    }
  }
}

// Of n pictures, half of them of the lit and half of the unlit monitor, the light of the unlit one is known
// to the noise of one over sqrt(n / 2): 0.28 of it for 26. Black with the object alone would be known to 1.
TEST(Hierarchical, LightBesideTheObjectIsThatOfAllPictures) {
  const Matte matte = SimulatedStack({}).solve().value();
  double square = 0.0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = kWidth / 2; x < kWidth; ++x) {
      for (const float found : matte.foreground(x, y))
        square += std::pow(static_cast<double>(found) - kRoom, 2);
    }
  }
  EXPECT_LT(std::sqrt(square / (kHeight * kWidth / 2 * kChannels)), 0.5 * kNoise);
}

TEST(Hierarchical, WithoutComplements) {
  expect_truth(SimulatedStack({.complements = false}).solve().value());
}

TEST(Hierarchical, WithoutSolidsOrAnEmptyStage) {
  const Matte matte = SimulatedStack({.solids = false, .empty_stage = false}).solve().value();
  expect_truth(matte);
  for (int y = 0; y < kHeight; ++y) EXPECT_NEAR(matte.foreground(0, y)[0], kForeground, 6.0 * kNoise / 3.0);
  // Nothing was recorded without the object: every pixel is solved.
  EXPECT_EQ(matte.coverage(kWidth - 1, 0), 1.0f);
  EXPECT_NEAR(matte.modes(kWidth - 1, 0, 0)[0].x_px, 2.0 * kWidth - 1.0, 0.2);
}

// Neither black nor white nor complements: a pixel's own lit and dark bars say what they are, where it sees
// both.
TEST(Hierarchical, WavesAlone) {
  const Matte matte =
      SimulatedStack({.solids = false, .complements = false, .empty_stage = false}).solve().value();
  const std::array<WaveAxis, 2> axes{WaveAxis(kHalves, kMonitor.width_px),
                                     WaveAxis(kHalves, kMonitor.height_px)};
  int solved = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      SCOPED_TRACE(testing::Message() << "pixel " << x << ", " << y);
      const Mode expected = truth(x, y, true);
      const std::array<Interval, 2> sides{side_of(expected.x_px, expected.xx_px2),
                                          side_of(expected.y_px, expected.yy_px2)};
      double least = 1.0, most = -1.0;
      std::array<double, WaveAxis::kMaxWaves> v;
      for (size_t a = 0; a < 2; ++a) {
        axes[a].means(sides[a], v);
        for (size_t k = 0; k < kHalves.size(); ++k) {
          least = std::min(least, v[k]);
          most = std::max(most, v[k]);
        }
      }
      if (most - least < 1.6) continue;
      ++solved;
      const Mode& mode = matte.modes(x, y, 1)[0];
      if (matte.flags(x, y) != kFlagNone) continue;
      EXPECT_NEAR(mode.x_px, expected.x_px, 0.5 * sides[0].length_px());
      EXPECT_NEAR(mode.y_px, expected.y_px, 0.5 * sides[1].length_px());
    }
  }
  int wrong = 0, unsaid = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      const Mode expected = truth(x, y, true);
      const Mode& mode = matte.modes(x, y, 1)[0];
      if (std::hypot(mode.x_px - expected.x_px, mode.y_px - expected.y_px) < 3.0f) continue;
      ++wrong;
      unsaid += matte.flags(x, y) == kFlagNone ? 1 : 0;
    }
  }
  EXPECT_GT(solved, kWidth / 2 * kHeight / 2);
  EXPECT_LT(wrong, kWidth / 2 * kHeight / 4);
  EXPECT_EQ(unsaid, 0);
}

TEST(Hierarchical, BarsOfAGrayCode) {
  expect_truth(SimulatedStack({.gray_code = true, .empty_stage = false}).solve().value(), kGrayCode);
}

TEST(Hierarchical, NoiseFromWavesAndComplements) {
  expect_truth(SimulatedStack({.empty_stage = false, .noise_model = false}).solve().value());
}

// Without complements the better fits of a row tell its noise. The third least of the chi-squares of 12
// boxes, each of some 30 degrees of freedom, is 0.6 to 1.1 of what it should be; taking an ordinary camera's
// 0.003 for the 0.002 that there is would make all errors half as large again.
TEST(Hierarchical, NoiseFromFits) {
  const Capture capture{.complements = false, .empty_stage = false};
  Capture unknown = capture;
  unknown.noise_model = false;
  const Matte matte = SimulatedStack(unknown).solve().value(),
              known = SimulatedStack(capture).solve().value();
  double sd = 0.0, known_sd = 0.0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      sd += static_cast<double>(matte.modes(x, y, 1)[0].weight_sd);
      known_sd += static_cast<double>(known.modes(x, y, 1)[0].weight_sd);
    }
  }
  EXPECT_GT(sd, std::sqrt(0.6) * known_sd);
  EXPECT_LT(sd, std::sqrt(1.1) * known_sd);
}

// The matte warns of positions that the remaining waves cannot distinguish.
TEST(Hierarchical, AMissingLevelIsToldOf) {
  SimulatedStack stack({.empty_stage = false});
  EXPECT_TRUE(stack.solve()->metadata.warnings().empty());
  stack.remove([](const v1::Frame& frame) { return frame.stimulus().bar_width_px() == 8.0; });
  const Matte matte = stack.solve().value();
  ASSERT_EQ(matte.metadata.warnings_size(), 2);
  EXPECT_NE(
      matte.metadata.warnings(0).find("vertical bars of monitor \"back\" are alike at 0.5 px and at 8.5 px"),
      std::string::npos)
      << matte.metadata.warnings(0);
}

// Bars of 16 px at most begin anew after 32, of 48: of two places in each of which such a pixel may see, the
// one next to what lies straight behind it is a guess.
TEST(Hierarchical, PlacesThatLookAlikeAreFlagged) {
  for (const bool empty_stage : {true, false}) {
    const Matte matte = SimulatedStack({.empty_stage = empty_stage, .first_level = 1}).solve().value();
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < 10; ++x) {
        SCOPED_TRACE(testing::Message() << "pixel " << x << ", " << y);
        const double truth_px = truth(x, y, true).x_px;
        const bool alike = truth_px >= 32.0;
        EXPECT_EQ(matte.flags(x, y), alike ? kFlagPoorFit : kFlagNone);
        if (alike && !empty_stage) continue;
        EXPECT_NEAR(matte.modes(x, y, 1)[0].x_px, alike ? truth_px - 32.0 : truth_px, 1.0);
      }
    }
  }
}

TEST(Hierarchical, BracketsAreMergedAndSaturationIsSaid) {
  expect_truth(SimulatedStack({.empty_stage = false, .exposures = {1.0, 4.0}}).solve().value());
  const Matte matte = SimulatedStack({.empty_stage = false, .light = 3.0}).solve().value();
  EXPECT_NE(matte.flags(3, 3) & kFlagSaturated, 0);
}

// What bars narrower than a pixel tell is a hundredth of a pixel on a smooth map; the bars here are known to
// a tenth.
TEST(Hierarchical, TheEmptyStageAloneHasItsMatte) {
  SimulatedStack stack({});
  stack.remove([](const v1::Frame& frame) { return frame.object(); });
  const Matte matte = stack.solve().value();
  for (int y = 1; y + 1 < kHeight; ++y) {
    for (int x = 1; x + 1 < kWidth; ++x) {
      const Mode expected = truth(x, y, false);
      const Mode& mode = matte.modes(x, y, 1)[0];
      EXPECT_EQ(matte.coverage(x, y), 0.0f);
      EXPECT_NEAR(mode.x_px, expected.x_px, 0.1) << x << " " << y;
      EXPECT_NEAR(mode.y_px, expected.y_px, 0.1) << x << " " << y;
      EXPECT_NEAR(mode.weight, expected.weight, 0.01) << x << " " << y;
      EXPECT_NEAR(matte.foreground(x, y)[1], kRoom, 5.0 * kNoise);
    }
  }
}

TEST(Hierarchical, SaysWhatIsMissing) {
  const auto refused = [](const Capture& capture, const std::function<bool(const v1::Frame&)>& unwanted,
                          const std::string& words) {
    SimulatedStack stack(capture);
    stack.remove(unwanted);
    const absl::Status status = stack.solve().status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  const auto none = [](const v1::Frame&) { return false; };
  refused(
      {}, [](const v1::Frame& f) { return f.stimulus().kind() == "square"; }, "no square waves");
  refused(
      {}, [](const v1::Frame& f) { return f.stimulus().orient() == "vertical_bars"; },
      "0 square waves of vertical bars");
  refused({.solids = false, .complements = false, .first_level = 3}, none,
          "3 square waves along an axis without complements; then black and a solid");
}

TEST(Hierarchical, ImpossibleStimuliAreRefused) {
  const auto refused = [](const std::function<void(v1::Stimulus&)>& change, const std::string& words) {
    SimulatedStack stack({});
    change(*stack.manifest().mutable_frames(5)->mutable_stimulus());
    const absl::Status status = stack.solve().status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  refused([](v1::Stimulus& s) { s.set_bar_width_px(0.25); }, "bars of 0.25 px");
  refused([](v1::Stimulus& s) { s.set_bar_width_px(NAN); }, "bars of nan px");
  refused([](v1::Stimulus& s) { s.set_offset_px(INFINITY); }, "from inf px");
  refused([](v1::Stimulus& s) { s.set_orient("slanted"); }, "\"slanted\"");
  refused([](v1::Stimulus& s) { s.set_panel("front"); }, "monitor \"front\"");
  refused(
      [](v1::Stimulus& s) {
        for (int c = 0; c < 3; ++c) s.add_colour(2.0);
      },
      "light of 2 2 2");
}

TEST(Hierarchical, OptionsAreChecked) {
  const auto refused = [](const std::string& method, const MethodOptions& options, const std::string& words) {
    const absl::Status status = make_method(method, options).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  refused("hierarchical", {{"partial_cover", "yes"}}, "partial_cover is \"yes\"; it must be 0 or 1");
  refused("hierarchical", {{"silhouette_tolerance", "-1"}}, "it must be 0 to 1");
  refused("hierarchical", {{"modes", "2"}}, "it has: partial_cover, silhouette_tolerance");
  refused("alpha", {{"backings", "3"}}, "it must be 1 or 2");
  refused("alpha", {{"backings", "1"}, {"a2", "9"}}, "it must be 0.5 to 1.5");
  refused("alpha", {{"a1", "1"}}, "needs backings=1");
  refused("alpha", {{"a3", "1"}}, "it has: backings, a1, a2");
}

// The object as alpha sees it: light of its own and no background.
TEST(Alpha, SolidsTellHowMuchIsSeenThrough) {
  const Matte matte = SimulatedStack({}).solve("alpha").value();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      // On solids it looks transparent: they do not show that the light comes from elsewhere.
      EXPECT_NEAR(matte.coverage(x, y), 0.0, 6.0 * kNoise);
      EXPECT_NEAR(matte.foreground(x, y)[1], kForeground, 6.0 * 2.0 * kNoise);
      EXPECT_NEAR(matte.modes(x, y, 1)[0].weight, 0.8,
                  6.0 * static_cast<double>(matte.modes(x, y, 1)[0].weight_sd));
      EXPECT_NEAR(matte.modes(x, y, 1)[0].x_px, 2.0 * x + 1.0, 0.5);
    }
  }
}

TEST(Alpha, OneColouredBackingIsEnough) {
  SimulatedStack stack({});
  EXPECT_TRUE(absl::IsFailedPrecondition(stack.solve("alpha", {{"backings", "1"}}).status()));
  for (const bool object : {true, false}) stack.add_solid(object, {0.0, 0.0, 1.0});
  const Matte matte = stack.solve("alpha", {{"backings", "1"}}).value();
  EXPECT_NEAR(matte.coverage(2, 2), 0.0, 6.0 * 2.0 * kNoise);
  EXPECT_NEAR(matte.foreground(2, 2)[1], kForeground, 6.0 * 2.0 * kNoise);
}

}  // namespace
}  // namespace glasswing
