// The smooth maps of simulated rigs whose geometry is known, and what pixels make of them.
#include "solver/background/stage_maps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "core/pattern/pattern.h"
#include "core/pattern/plan.h"
#include "solver/background/surroundings.h"
#include "tests/solver/stack_of.h"

namespace glasswing {
namespace {

constexpr int kWidth = 48, kHeight = 36;
constexpr MonitorSize kMonitor{64, 48};
constexpr double kNoise = 0.003, kSigma_px = 0.5, kWeight = 0.8;

// Where a point of the picture looks.
using Truth = std::function<std::array<double, 2>(double x_px, double y_px)>;

// A camera that is turned and stands aside, behind a lens.
std::array<double, 2> bent(double x, double y) {
  const double u = x / 24.0 - 1.0, v = y / 18.0 - 1.0, bend = 1.0 + 0.02 * (u * u + v * v);
  const double depth = 1.0 + 0.04 * u - 0.03 * v;
  return {32.0 + (26.0 * u - 2.0 * v) * bend / depth, 24.0 + (2.0 * u + 19.0 * v) * bend / depth};
}

const std::string kSolids = "solids { colour: [0, 0, 0] } solids { colour: [1, 1, 1] } ",
                  kBars = "square_waves { levels: 6 } ",
                  kSweeps =
                      "sweeps { orientation_deg: 0 sigma_px: 3 step_px: 3 } "
                      "sweeps { orientation_deg: 90 sigma_px: 3 step_px: 3 } "
                      "sweeps { orientation_deg: 45 sigma_px: 3 step_px: 3 } ";

// The part of a pixel's light that comes from one of the monitor's.
struct Share {
  int x = 0, y = 0;
  float part = 0.0f;
};
std::vector<Share> shares_of(std::array<double, 2> centre_px) {
  const auto within = [](int pixel, double centre) {
    const auto below = [centre](double edge) {
      return 0.5 * std::erfc((centre - edge) / (std::numbers::sqrt2 * kSigma_px));
    };
    return below(pixel + 1.0) - below(pixel);
  };
  std::vector<Share> shares;
  for (int y = 0; y < kMonitor.height_px; ++y) {
    for (int x = 0; x < kMonitor.width_px; ++x) {
      const double part = kWeight * within(x, centre_px[0]) * within(y, centre_px[1]);
      if (part > 1e-7) shares.push_back({.x = x, .y = y, .part = static_cast<float>(part)});
    }
  }
  return shares;
}

// The empty stage, seen twice: as if the object were not there when it is.
struct Rig {
  v1::CaptureManifest manifest;
  std::vector<Image16> frames;

  Rig(const Truth& truth, const std::string& plan, double noise_sd = kNoise) {
    manifest.mutable_camera()->set_width_px(kWidth);
    manifest.mutable_camera()->set_height_px(kHeight);
    manifest.mutable_camera()->set_bits(16);
    manifest.mutable_camera()->set_read_sd(noise_sd);
    v1::Monitor& monitor = *manifest.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(kMonitor.width_px);
    monitor.set_height_px(kMonitor.height_px);
    std::vector<std::vector<Share>> shares;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) shares.push_back(shares_of(truth(x + 0.5, y + 0.5)));
    }
    std::mt19937 random(3);
    std::normal_distribution<float> normal(0.0f, static_cast<float>(noise_sd));
    const std::vector<Step> steps =
        expand(parse_plan("method: 'gaussian' " + plan, "plan").value(), {monitor}).value();
    for (const Step& step : steps) {
      v1::Frame& frame = *manifest.add_frames();
      frame.set_file(std::to_string(step.number) + ".tif");
      frame.set_object(step.object);
      *frame.mutable_stimulus() = step.stimulus;
      const RadianceImage shown = Pattern::create(step.stimulus, kMonitor).value().rasterised();
      Image16& image = frames.emplace_back(kWidth, kHeight);
      for (size_t i = 0; i < image.samples.size(); ++i) {
        float light = 0.01f + normal(random);
        for (const Share& share : shares[i / 3])
          light += share.part * shown.at(share.x, share.y, static_cast<int>(i % 3));
        image.samples[i] = code16_of(light);
      }
    }
  }

  FrameStack rows(int first, int count) const {
    FrameStack stack = stack_of(manifest, frames);
    stack.first_row = first;
    stack.row_count = count;
    for (auto& row : stack.rows)
      row = row.subspan(stack.sample_index(0, first, 0), stack.sample_index(0, count, 0));
    return stack;
  }

  StageMaps maps() const {
    std::vector<int> all;
    for (int i = 0; i < manifest.frames_size(); ++i) all.push_back(i);
    return measure_stage_maps(
               manifest, all,
               [&](int row, const std::vector<int>&) { return absl::StatusOr<FrameStack>(rows(row, 1)); })
        .value();
  }

  // The rows as every method settles them, on these maps.
  Matte settled(std::shared_ptr<const StageMaps> maps, int first = 0, int count = kHeight) const {
    FrameStack stack = rows(first, count);
    stack.stage_maps = std::move(maps);
    const StageLayout layout = lay_out_stage(manifest, Exposures::of(manifest).value());
    Surroundings surroundings(stack, layout, 0.0);
    Matte matte(0, first, kWidth, count, 1);
    for (int y = 0; y < count; ++y) surroundings.settle_row(y, {}, matte);
    return matte;
  }
};

// Of the pixels that look at the monitor, its outermost pixel aside.
double rms_px(const Matte& matte, const Truth& truth, const std::function<bool(int x)>& wanted) {
  double squares = 0.0, count = 0.0;
  int taken_for_object = 0;  // noise does that once in ten thousand pixels
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto [u, v] = truth(x + 0.5, matte.y0_px() + y + 0.5);
      if (!wanted(x) || u < 1.0 || v < 1.0 || u > kMonitor.width_px - 1.0 || v > kMonitor.height_px - 1.0)
        continue;
      const Mode& mode = matte.modes(x, y, 1)[0];
      if (matte.coverage(x, y) > 0.0f) {
        ++taken_for_object;
        continue;
      }
      squares += std::pow(static_cast<double>(mode.x_px) - u, 2.0) +
                 std::pow(static_cast<double>(mode.y_px) - v, 2.0);
      count += 2.0;
    }
  }
  EXPECT_LE(taken_for_object, 2);
  return std::sqrt(squares / count);
}
bool everywhere(int) {
  return true;
}

std::shared_ptr<const StageMaps> shared(StageMaps maps) {
  return std::make_shared<const StageMaps>(std::move(maps));
}

TEST(SweepPeak, IsWhereTheStripePassed) {
  std::vector<double> r_px, y;
  for (double r = -9.0; r <= 60.0; r += 3.0) {
    r_px.push_back(r);
    y.push_back(0.1 + 0.7 * std::exp(-0.5 * std::pow((r - 20.7) / 3.3, 2.0)));
  }
  const SweepPeak peak = find_sweep_peak(r_px, y, 3.0);
  ASSERT_TRUE(peak.found);
  EXPECT_NEAR(peak.centre_px, 20.7, 1e-6);
  EXPECT_NEAR(peak.height, 0.7, 1e-6);
  // Of a Gaussian of height a and width s, sampled every d: sd of t = (d / s / sqrt(pi))^(1/2) sqrt(2) s / a.
  EXPECT_NEAR(peak.centre_sd_px,
              std::sqrt(3.0 / 3.3 / std::sqrt(std::numbers::pi)) * std::numbers::sqrt2 * 3.3 / 0.7,
              0.1 * peak.centre_sd_px);
  // Half of it was swept.
  EXPECT_FALSE(find_sweep_peak(std::span(r_px).first(10), std::span(y).first(10), 3.0).found);
  y.assign(y.size(), 0.3);
  EXPECT_FALSE(find_sweep_peak(r_px, y, 3.0).found);
}

TEST(StageMaps, BarsAndSweepsTogether) {
  const Rig rig(bent, kSolids + "square_waves { levels: 4 } " + kSweeps);  // bars of 4 px and more
  const StageMaps maps = rig.maps();
  EXPECT_TRUE(maps.warnings.empty()) << maps.warnings.front();
  ASSERT_TRUE(maps.of_monitor[0]);
  const Matte on_map = rig.settled(shared(maps)), own = rig.settled(nullptr);
  std::printf("on the map %.4f px rms (says %.4f), own bars %.4f px\n", rms_px(on_map, bent, everywhere),
              maps.of_monitor[0]->sd_px, rms_px(own, bent, everywhere));
  EXPECT_LT(rms_px(on_map, bent, everywhere), 0.02);
  EXPECT_GT(rms_px(own, bent, everywhere), 2.0 * rms_px(on_map, bent, everywhere));
  const Mode& mode = on_map.modes(20, 20, 1)[0];
  EXPECT_NEAR(std::sqrt(mode.xx_px2), kSigma_px, 0.1);
  EXPECT_NEAR(static_cast<double>(mode.weight), kWeight, 0.01);
}

TEST(StageMaps, SweepsAlone) {
  const Rig rig(bent, kSolids + kSweeps);
  const StageMaps maps = rig.maps();
  EXPECT_TRUE(maps.warnings.empty()) << maps.warnings.front();
  EXPECT_LT(rms_px(rig.settled(shared(maps)), bent, everywhere), 0.02);
}

TEST(StageMaps, BarsAlone) {
  const Rig rig(bent, kSolids + kBars);
  const StageMaps maps = rig.maps();
  EXPECT_TRUE(maps.warnings.empty()) << maps.warnings.front();
  EXPECT_LT(rms_px(rig.settled(shared(maps)), bent, everywhere), 0.03);
}

TEST(StageMaps, CoarseBarsAloneDoNotTell) {
  const StageMaps maps = Rig(bent, kSolids + "square_waves { levels: 4 } ").maps();
  EXPECT_FALSE(maps.of_monitor[0]);
  ASSERT_EQ(maps.warnings.size(), 1u);
  EXPECT_EQ(maps.warnings[0],
            "the background on monitor \"back\" is taken from each pixel's own bars, not from one smooth "
            "surface: 0 "
            "positions were found; at least 60 are needed");
}

TEST(StageMaps, APartThatLooksElsewhereKeepsItsOwnPlaces) {
  // Columns 30 to 39 see the monitor in a mirror.
  const auto in_mirror = [](int x) { return x >= 30 && x < 40; };
  const Truth truth = [&](double x, double y) {
    return in_mirror(static_cast<int>(x)) ? std::array{50.0 - 0.9 * x, 10.0 + 0.9 * y} : bent(x, y);
  };
  const Rig rig(truth, kSolids + kBars + kSweeps);
  const StageMaps maps = rig.maps();
  ASSERT_TRUE(maps.of_monitor[0]) << maps.warnings.front();
  ASSERT_EQ(maps.warnings.size(), 1u);
  EXPECT_EQ(
      maps.warnings[0],
      "21 % of the background on monitor \"back\" does not lie on the smooth surface of the rest; those "
      "pixels keep the positions from their own bars");
  const Matte matte = rig.settled(shared(maps)), own = rig.settled(nullptr);
  EXPECT_LT(rms_px(matte, truth, [&](int x) { return !in_mirror(x); }), 0.02);
  EXPECT_EQ(rms_px(matte, truth, in_mirror), rms_px(own, truth, in_mirror));
}

TEST(StageMaps, WhereThereIsNoneNothingChangesAndAWarningSaysWhy) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform;
  const Truth shuffled = [&](double, double) {
    return std::array{64.0 * uniform(random), 48.0 * uniform(random)};
  };
  const Rig rig(shuffled, kSolids + kBars);
  const StageMaps maps = rig.maps();
  EXPECT_FALSE(maps.of_monitor[0]);
  ASSERT_EQ(maps.warnings.size(), 1u);
  EXPECT_TRUE(
      maps.warnings[0].starts_with("the background on monitor \"back\" is taken from each pixel's own bars, "
                                   "not from one smooth surface: "))
      << maps.warnings[0];
  const Matte own = rig.settled(nullptr), settled = rig.settled(shared(maps));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) EXPECT_EQ(settled.modes(x, y, 0)[0].x_px, own.modes(x, y, 0)[0].x_px);
  }
}

TEST(StageMaps, WithoutEvidenceThereIsNothingToWarnOf) {
  for (const std::string& plan : {kSolids, kSolids + kBars + kSweeps + "skip_empty_stage: true"}) {
    const StageMaps maps = Rig(bent, plan).maps();
    EXPECT_FALSE(maps.of_monitor[0]);
    EXPECT_TRUE(maps.warnings.empty()) << maps.warnings.front();
  }
}

TEST(StageMaps, RowsJoinWithoutSeams) {
  const Rig rig(bent, kSolids + kBars + kSweeps);
  const auto maps = shared(rig.maps());
  const Matte whole = rig.settled(maps), part = rig.settled(maps, 11, 9);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_EQ(part.modes(x, y, 2)[0].x_px, whole.modes(x, 11 + y, 2)[0].x_px);
      EXPECT_EQ(part.modes(x, y, 2)[0].weight, whole.modes(x, 11 + y, 2)[0].weight);
    }
  }
}

}  // namespace
}  // namespace glasswing
