// Plans for monitors from small to large, and what each warning is for.
#include "core/pattern/plan_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/image/image.h"
#include "core/pattern/id_patch.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

v1::Monitor monitor(const std::string& name, int width_px, int height_px, double refresh_hz = 60.0) {
  v1::Monitor monitor;
  monitor.set_name(name);
  monitor.set_width_px(width_px);
  monitor.set_height_px(height_px);
  monitor.set_refresh_hz(refresh_hz);
  return monitor;
}

v1::GetCameraResponse camera(double rate_hz, double min_ms, double max_ms, double readout_ms) {
  v1::GetCameraResponse camera;
  camera.set_frame_rate_hz(rate_hz);
  camera.set_min_exposure_ms(min_ms);
  camera.set_max_exposure_ms(max_ms);
  camera.set_readout_ns(std::llround(1e6 * readout_ms));
  return camera;
}

constexpr std::pair<int, int> kSizes[] = {{128, 96}, {1280, 720}, {1920, 1080}, {1080, 1920}, {3840, 2160}};
constexpr PlanQuality kQualities[] = {PlanQuality::kDraft, PlanQuality::kGood, PlanQuality::kBest};

TEST(PlanFit, MakesPlansThatFitEverySizeAndReadBackAsTheyAre) {
  for (const auto& [width_px, height_px] : kSizes) {
    const RigLimits rig{.monitors = {monitor("back", width_px, height_px)},
                        .camera = camera(60.0, 0.1, 16.0, 5.0),
                        .blur_px = 0.0};
    int images = 0;
    for (const PlanQuality quality : kQualities) {
      const absl::StatusOr<v1::Plan> plan = make_plan({.quality = quality, .images = {}}, rig);
      ASSERT_OK(plan);
      EXPECT_TRUE(misfits(*plan, rig).empty()) << misfits(*plan, rig)[0];
      EXPECT_GT(images_of(*plan, rig), images);  // each quality takes more than the one before
      images = images_of(*plan, rig);
      const absl::StatusOr<v1::Plan> read = parse_plan(plan_text(*plan, rig), "made.txtpb");
      ASSERT_OK(read);
      EXPECT_EQ(read->DebugString(), plan->DebugString());
    }
  }
}

// A camera pixel for a monitor pixel, blurred by a Gaussian of `sigma_px` along both axes.
Image16 blurred(const RadianceImage& picture, double sigma_px) {
  const int reach = static_cast<int>(std::ceil(3.0 * sigma_px));
  RadianceImage from = picture;
  for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{0, 1}}) {
    RadianceImage to(picture.width_px, picture.height_px);
    for (int y = 0; y < to.height_px; ++y) {
      for (int x = 0; x < to.width_px; ++x) {
        double light = 0.0, weight = 0.0;
        for (int k = -reach; k <= reach; ++k) {
          const int u = x + k * dx, v = y + k * dy;
          const double own = k == 0 ? 1.0 : std::exp(-0.5 * k * k / (sigma_px * sigma_px));
          weight += own;
          if (u >= 0 && u < to.width_px && v >= 0 && v < to.height_px)
            light += own * static_cast<double>(from.at(u, v, 0));
        }
        for (int c = 0; c < 3; ++c) to.at(x, y, c) = static_cast<float>(light / weight);
      }
    }
    from = to;
  }
  Image16 frame(picture.width_px, picture.height_px);
  for (size_t i = 0; i < frame.samples.size(); ++i) frame.samples[i] = code16_of(0.6f * from.samples[i]);
  return frame;
}

TEST(PlanFit, AnIdPatchOfTheAdvisedRowsIsReadThroughTheBlur) {
  for (const double blur_px : {0.0, 1.5, 4.0}) {
    const RigLimits rig{.monitors = {monitor("back", 640, 96)}, .camera = {}, .blur_px = blur_px};
    const int rows = patch_rows_for(rig);
    EXPECT_EQ(rows % 2, 0);
    const auto frame = [&](std::uint16_t id) {
      RadianceImage picture(640, rows);
      IdPatch{.width_px = 640, .first_row = 0, .rows = rows}.draw(id, picture);
      return blurred(picture, blur_px);
    };
    std::vector<Image16> lessons;
    for (const std::uint16_t id : patch_learning_ids()) lessons.push_back(frame(id));
    const absl::StatusOr<PatchReader> reader = PatchReader::learn(lessons);
    ASSERT_OK(reader) << blur_px << ": " << reader.status();
    EXPECT_EQ(reader->read(frame(0xA5C3)), 0xA5C3) << blur_px;
  }
}

TEST(PlanFit, ThePlansFileAdvisesAnIdPatchWhereThereIsNone) {
  RigLimits rig{.monitors = {monitor("back", 1920, 1080)}, .camera = {}, .blur_px = 0.0};
  const v1::Plan plan = *make_plan({}, rig);
  EXPECT_NE(plan_text(plan, rig).find("glasswing-display --patch-rows 46"), std::string::npos);
  rig.monitors[0].set_patch_rows(48);
  EXPECT_EQ(plan_text(plan, rig).find("--patch-rows"), std::string::npos);
}

TEST(PlanFit, ADraftTakesAHundredImagesOnAnyMonitor) {
  for (const auto& [width_px, height_px] : kSizes) {
    const RigLimits rig{.monitors = {monitor("back", width_px, height_px)}, .camera = {}, .blur_px = 0.0};
    const int images = images_of(*make_plan({.quality = PlanQuality::kDraft, .images = {}}, rig), rig);
    EXPECT_LE(images, 100);
    EXPECT_GT(images, 85) << width_px;
  }
}

TEST(PlanFit, ImagesChooseTheNarrowestStripesThatKeepToThem) {
  const RigLimits rig{
      .monitors = {monitor("back", 1920, 1080), monitor("left", 1080, 1920)}, .camera = {}, .blur_px = 0.0};
  for (const int wished : {300, 1000, 3000}) {
    v1::Plan plan = *make_plan({.quality = PlanQuality::kGood, .images = wished}, rig);
    EXPECT_LE(images_of(plan, rig), wished);
    for (v1::Sweep& sweep : *plan.mutable_sweeps()) {
      sweep.set_sigma_px(sweep.sigma_px() - 0.25);
      sweep.set_step_px(0.5 * sweep.sigma_px());
    }
    EXPECT_GT(images_of(plan, rig), wished);
  }
  const absl::Status few = make_plan({.quality = PlanQuality::kGood, .images = 20}, rig).status();
  EXPECT_EQ(few.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(few.message().find("the widest stripes take"), std::string::npos) << few;
  EXPECT_FALSE(make_plan({}, {}).ok());
}

TEST(PlanFit, ExposuresAndHoldFitTheCamera) {
  RigLimits rig{.monitors = {monitor("back", 1920, 1080, 60.0)},
                .camera = camera(200.0, 0.1, 4.9, 0.0),
                .blur_px = 0.0};
  v1::Plan plan = *make_plan({.quality = PlanQuality::kBest, .images = {}}, rig);
  EXPECT_EQ(plan.hold_refreshes(), 2);
  ASSERT_EQ(plan.exposure_ms_size(), 2);
  EXPECT_EQ(plan.exposure_ms(0), 4.0);
  EXPECT_EQ(plan.exposure_ms(1), 0.5);
  // 8 ms + 16.7 ms of readout + 16.7 ms a frame = 41.3 ms, and 16.7 ms of scan-out: four refreshes.
  rig.camera = camera(60.0, 8.0, 16.0, 16.7);
  plan = *make_plan({.quality = PlanQuality::kBest, .images = {}}, rig);
  EXPECT_EQ(plan.hold_refreshes(), 4);
  ASSERT_EQ(plan.exposure_ms_size(), 1);  // no shorter one is possible
  EXPECT_EQ(plan.exposure_ms(0), 8.0);
  rig.camera = camera(0.05, 8.0, 16.0, 0.0);
  EXPECT_FALSE(make_plan({}, rig).ok());
}

// Frames begin at any phase: over many phases, the chosen hold proves a step in the fewest refreshes.
TEST(PlanFit, APictureIsShownAsLongAsProvesMostStepsOfAFreeRunningCamera) {
  for (const double rate_hz : {4.0, 15.0, 25.0, 60.0, 100.0, 200.0}) {
    for (const double refresh_hz : {4.0, 24.0, 60.0, 144.0}) {
      SCOPED_TRACE(testing::Message() << rate_hz << " frames/s at " << refresh_hz << " Hz");
      constexpr double kExposure_ms = 4.0, kSettling_ms = 1.0;
      const RigLimits rig{.monitors = {monitor("back", 128, 96, refresh_hz)},
                          .camera = camera(rate_hz, 0.1, 4.0, 0.0),
                          .blur_px = 0.0};
      const auto refreshes_a_step = [&](int hold) {
        constexpr int kPhases = 2000;
        const double from_ms = 1e3 / refresh_hz + kSettling_ms, until_ms = 1e3 * hold / refresh_hz;
        int proven = 0;
        for (int i = 0; i < kPhases; ++i) {
          const double period_ms = 1e3 / rate_hz, phase_ms = period_ms * (i + 0.5) / kPhases;
          const double first_ms = phase_ms + period_ms * std::ceil((from_ms - phase_ms) / period_ms);
          proven += first_ms + kExposure_ms <= until_ms;
        }
        return proven == 0 ? 1e9 : static_cast<double>(hold) * kPhases / proven;
      };
      double least = 1e9;
      for (int hold = 2; hold <= 120; ++hold) least = std::min(least, refreshes_a_step(hold));
      const int chosen = make_plan({}, rig).value().hold_refreshes();
      EXPECT_LE(refreshes_a_step(chosen), 1.005 * least) << chosen;
    }
  }
}

TEST(PlanFit, ObjectsChooseStripesAndExposures) {
  RigLimits rig{
      .monitors = {monitor("back", 128, 96, 60.0)}, .camera = camera(200.0, 0.1, 20.0, 0.0), .blur_px = 0.0};
  const auto plan_of = [&](ObjectKind object) {
    return *make_plan({.quality = PlanQuality::kGood, .images = {}, .object = object}, rig);
  };
  const v1::Plan clear = plan_of(ObjectKind::kClear);
  EXPECT_EQ(plan_of(ObjectKind::kFrosted).sweeps(0).sigma_px(), 2.0 * clear.sweeps(0).sigma_px());
  const v1::Plan metal = plan_of(ObjectKind::kMetal), dark = plan_of(ObjectKind::kDark);
  ASSERT_EQ(metal.exposure_ms_size(), 2);
  EXPECT_EQ(metal.exposure_ms(1), clear.exposure_ms(0) / 8.0);
  // As long as the camera exposes; 20 ms, 5 ms a frame and a scan-out are three refreshes.
  ASSERT_EQ(dark.exposure_ms_size(), 2);
  EXPECT_EQ(dark.exposure_ms(0), 20.0);
  EXPECT_EQ(dark.exposure_ms(1), clear.exposure_ms(0));
  EXPECT_EQ(dark.hold_refreshes(), 3);
  rig.camera = camera(200.0, 0.1, 100.0, 0.0);
  EXPECT_EQ(plan_of(ObjectKind::kDark).hold_refreshes(), 4);  // 32 + 5 + 16.7 ms
}

TEST(PlanFit, StripesAreNotNarrowerThanTheBlur) {
  const RigLimits rig{.monitors = {monitor("back", 128, 96)}, .camera = {}, .blur_px = 6.2};
  EXPECT_EQ(make_plan({.quality = PlanQuality::kGood, .images = {}}, rig)->sweeps(0).sigma_px(), 6.5);
}

std::vector<std::string> misfits_of(const std::string& text, const RigLimits& rig) {
  return misfits(parse_plan(text, "plan.txtpb").value(), rig);
}

std::string sweeps_of(const std::vector<int>& orientations_deg) {
  std::string text;
  for (const int degrees : orientations_deg)
    text += "sweeps { sigma_px: 4 step_px: 2 orientation_deg: " + std::to_string(degrees) + " } ";
  return text;
}

TEST(PlanFit, WarnsOfTooFewOrientationsForTheMethod) {
  const std::string gaussian = "method: \"gaussian\" monitors { name: \"back\" } ";
  EXPECT_TRUE(misfits_of(gaussian + sweeps_of({0, 90, 45}), {}).empty());
  for (const std::vector<int>& too_few : {std::vector{0}, {0, 90}, {0, 90, 180, -90}}) {
    const std::vector<std::string> found = misfits_of(gaussian + sweeps_of(too_few), {});
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NE(found[0].find("at least 3, such as 0, 90 and 45 deg"), std::string::npos) << found[0];
  }
}

TEST(PlanFit, WarnsOfTooFewLevelsForTheMonitor) {
  const std::string crystal =
      "method: \"gaussian\" monitors { name: \"back\" } square_waves { levels: 7 } " + sweeps_of({0, 90, 45});
  EXPECT_TRUE(
      misfits_of(crystal, {.monitors = {monitor("back", 128, 96)}, .camera = {}, .blur_px = 0.0}).empty());
  const std::vector<std::string> large =
      misfits_of(crystal, {.monitors = {monitor("back", 1920, 1080)}, .camera = {}, .blur_px = 0.0});
  ASSERT_EQ(large.size(), 1u);
  EXPECT_NE(large[0].find("\"back\" (1920x1080) the finest bars are 16 px wide"), std::string::npos)
      << large[0];
  EXPECT_NE(large[0].find("levels: 8 makes them 8 px"), std::string::npos) << large[0];
  const std::string bars = "method: \"hierarchical\" monitors { name: \"back\" } square_waves { levels: 7 }";
  EXPECT_EQ(
      misfits_of(bars, {.monitors = {monitor("back", 1920, 1080)}, .camera = {}, .blur_px = 0.0}).size(), 1u);
  EXPECT_TRUE(
      misfits_of(bars, {.monitors = {monitor("other", 1920, 1080)}, .camera = {}, .blur_px = 0.0}).empty());
  // The plan's own size, without a rig.
  EXPECT_EQ(misfits_of("method: \"hierarchical\" monitors { name: \"back\" width_px: 1920 height_px: 1080 } "
                       "square_waves { levels: 7 }",
                       {})
                .size(),
            1u);
}

TEST(PlanFit, WarnsOfNarrowStripesAndOfExposuresOutsideTheCamerasWindow) {
  const std::string plan =
      "method: \"gaussian\" monitors { name: \"back\" } exposure_ms: [4, 20, 40] " + sweeps_of({0, 90, 45});
  RigLimits rig{.monitors = {monitor("back", 128, 96)}, .camera = {}, .blur_px = 5.0};
  std::vector<std::string> found = misfits_of(plan, rig);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NE(found[0].find("narrower than the blur of camera and monitor, 5 px"), std::string::npos)
      << found[0];
  rig = {.monitors = {monitor("back", 128, 96)}, .camera = camera(50.0, 0.1, 20.0, 1.0), .blur_px = 0.0};
  found = misfits_of(plan, rig);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NE(found[0].find("20 ms needs 41 ms"), std::string::npos) << found[0];
  EXPECT_NE(found[0].find("hold_refreshes to 3"), std::string::npos) << found[0];
  EXPECT_NE(found[1].find("exposure_ms is 40; the camera takes 0.1 to 20 ms"), std::string::npos) << found[1];
}

}  // namespace
}  // namespace glasswing
