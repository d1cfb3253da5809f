// Patterns made of recorded ones, held against pictures of the same patterns that an independent renderer
// made.
#include "tests/results/rendered_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

namespace glasswing {
namespace {

// Reads what it is given, as it is.
class Every final : public Method {
 public:
  absl::StatusOr<std::vector<int>> frames_needed(const v1::CaptureManifest& manifest) const override {
    std::vector<int> all;
    for (int i = 0; i < manifest.frames_size(); ++i) all.push_back(i);
    return all;
  }
  absl::StatusOr<Matte> solve(const FrameStack&) const override {
    return absl::UnimplementedError("solves nothing");
  }
};

class RenderedSceneTest : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const char* data = std::getenv("GLASSWING_DATA");
    directory_ = std::filesystem::path(data == nullptr ? "/nonexistent" : data) / "rendered/dev" / GetParam();
    if (!std::filesystem::exists(directory_)) GTEST_SKIP() << "no data at " << directory_;
  }

  std::filesystem::path directory_;
};

// The ramp's red grows along x, so it is a sum of stripes that travelled along x, and it was recorded too.
TEST_P(RenderedSceneTest, ARampOfStripesIsTheRampThatWasRecorded) {
  const RenderedScene scene(directory_);
  StripeSums sums(scene.manifest());
  for (int i = 0; i < scene.manifest().frames_size(); ++i) {
    const v1::Frame& ramp = scene.manifest().frames(i);
    if (ramp.file() != "obj/ramp.png") continue;  // another has noise
    MadeCapture capture = part_of(scene.manifest(), [](const v1::Frame&) { return false; });
    capture.add(ramp, {{.frame = i, .weight = 1.0}});
    capture.add(ramp, sums.parts(ramp.stimulus(), 0.0).value());
    const FrameStack stack = scene.stack(Every(), capture).value();
    // The sum is the ramp within 1e-3 of white on every pixel of the monitor, and no pixel sees more than all
    // of a monitor's light.
    for (size_t at = 0; at < stack.rows[0].size(); at += 3)
      ASSERT_NEAR(stack.rows[0][at], stack.rows[1][at], 1e-3 * 65535.0 + 2.0)
          << ramp.file() << ", sample " << at;
    return;
  }
  FAIL() << "no ramp was recorded";
}

TEST_P(RenderedSceneTest, TheEmptyStageIsAsItWasRecorded) {
  const RenderedScene scene(directory_);
  MadeCapture recorded = part_of(scene.manifest(), [](const v1::Frame& frame) {
    return !frame.object() && (frame.stimulus().kind() == "square" || frame.stimulus().kind() == "solid");
  });
  ASSERT_FALSE(recorded.parts.empty());
  MadeCapture made = recorded;
  for (std::vector<Part>& parts : made.parts) parts.clear();
  const FrameStack a = scene.stack(Every(), recorded).value(), b = scene.stack(Every(), made).value();
  for (size_t frame = 0; frame < a.rows.size(); ++frame) {
    for (size_t at = 0; at < a.rows[frame].size(); ++at)
      ASSERT_NEAR(a.rows[frame][at], b.rows[frame][at], 1.0)
          << recorded.manifest.frames(static_cast<int>(frame)).file();
  }
}

// Where no sum of the stripes is the pattern it is refused.
TEST_P(RenderedSceneTest, ASinusoidFinerThanTheStripesIsRefused) {
  const RenderedScene scene(directory_);
  StripeSums sums(scene.manifest());
  v1::Stimulus wave;
  wave.set_kind("sinusoid");
  wave.set_panel(scene.manifest().monitors(0).name());
  wave.set_period_px(4.0);
  wave.set_peak(1.0);
  EXPECT_EQ(sums.parts(wave, 0.0).status().code(), absl::StatusCode::kFailedPrecondition);
}

INSTANTIATE_TEST_SUITE_P(Scenes, RenderedSceneTest,
                         testing::Values("A_crystal", "B_bimodal", "C_brushed", "D_foreground",
                                         "E_twomonitors", "G_misregistered"),
                         [](const auto& scene) { return std::string(scene.param); });

}  // namespace
}  // namespace glasswing
