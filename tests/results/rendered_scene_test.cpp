// Compares patterns synthesized from recorded ones with an independent renderer's pictures of the same
// patterns.
#include "tests/results/rendered_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numeric>

namespace glasswing {
namespace {

// Needs every frame.
class Every final : public Method {
 public:
  absl::StatusOr<std::unique_ptr<PreparedMethod>> prepare(
      const v1::CaptureManifest& manifest) const override {
    return std::make_unique<Prepared>(manifest.frames_size());
  }

 private:
  class Prepared final : public PreparedMethod {
   public:
    explicit Prepared(int frame_count) : all_(static_cast<size_t>(frame_count)) {
      std::iota(all_.begin(), all_.end(), 0);
    }
    const std::vector<int>& frames_needed() const override { return all_; }
    absl::StatusOr<Matte> solve(const FrameStack&) const override {
      return absl::UnimplementedError("solves nothing");
    }

   private:
    std::vector<int> all_;
  };
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

// The ramp's red increases along x, so it is a sum of stripes that travelled along x; it was recorded too.
TEST_P(RenderedSceneTest, ARampOfStripesIsTheRampThatWasRecorded) {
  const RenderedScene scene(directory_);
  StripeSums sums(scene.manifest());
  for (int i = 0; i < scene.manifest().frames_size(); ++i) {
    const v1::Frame& ramp = scene.manifest().frames(i);
    if (ramp.file() != "obj/ramp.png") continue;  // the other one has noise
    SynthesizedCapture capture = part_of(scene.manifest(), [](const v1::Frame&) { return false; });
    capture.add(ramp, {{.frame = i, .weight = 1.0}});
    capture.add(ramp, sums.parts(ramp.stimulus(), 0.0).value());
    const FrameStack stack = scene.stack(Every(), capture).value();
    // The sum is the ramp within 1e-3 of white on every pixel of the monitor, and no pixel sees more than a
    // monitor's total light.
    for (size_t at = 0; at < stack.rows[0].size(); at += 3)
      ASSERT_NEAR(stack.rows[0][at], stack.rows[1][at], 1e-3 * 65535.0 + 2.0)
          << ramp.file() << ", sample " << at;
    return;
  }
  FAIL() << "no ramp was recorded";
}

TEST_P(RenderedSceneTest, TheEmptyStageIsAsItWasRecorded) {
  const RenderedScene scene(directory_);
  SynthesizedCapture recorded = part_of(scene.manifest(), [](const v1::Frame& frame) {
    return !frame.object() && (frame.stimulus().kind() == "square" || frame.stimulus().kind() == "solid");
  });
  ASSERT_FALSE(recorded.parts.empty());
  SynthesizedCapture straight = recorded;
  for (std::vector<Part>& parts : straight.parts) parts.clear();
  const FrameStack a = scene.stack(Every(), recorded).value(), b = scene.stack(Every(), straight).value();
  for (size_t frame = 0; frame < a.rows.size(); ++frame) {
    for (size_t at = 0; at < a.rows[frame].size(); ++at)
      ASSERT_NEAR(a.rows[frame][at], b.rows[frame][at], 1.0)
          << recorded.manifest.frames(static_cast<int>(frame)).file();
  }
}

// A pattern that is not a sum of the stripes is refused.
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
