#include "core/calibration/screen_view.h"

#include "tests/core/calibration/simulated_grays.h"

namespace glasswing {
namespace {

using ScreenViewTest = SimulatedGrays;

TEST_F(ScreenViewTest, SeesTheScreenAndNotItsPatchOrTheTable) {
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
  // Except its rim, which is 3 %.
  EXPECT_GT(view.pixels.size(), 0.95 * kScreen.width_px * kScreen.height_px);
}

}  // namespace
}  // namespace glasswing
