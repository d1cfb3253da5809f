// Scripts for Nuke, by an evaluator of their nodes (nuke_graph.py), against `glasswing composite`. Nuke
// itself was never asked.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>

#include "compositing/hosts/nuke/nuke_script.h"
#include "core/composite/compositor.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/rays/ray_file.h"
#include "tests/compositing/host_mattes.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/core/matte/other_program.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 48, kHeight = 36;

class Nuke : public ScratchTest {
 protected:
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }

  // What the script of a matte makes of pictures on both monitors: PSNR to the composite.
  double psnr_db(const Matte& matte, const RadianceImage& back, const RadianceImage& left) const {
    EXPECT_OK(write_file_durably(path("vase.exr"), encode_matte(matte).value()));
    EXPECT_OK(write_radiance(path("back.exr"), back, Encoding::kLinear));
    EXPECT_OK(write_radiance(path("left.exr"), left, Encoding::kLinear));
    const Outcome written = run_glasswing({"nuke", path("vase.exr"), "-o", path("vase.nk")});
    EXPECT_EQ(written.status, 0) << written.err;
    const Said said =
        run_program(fmt::format("cd {} && /usr/bin/python3 {} vase.nk out.raw back=back.exr left=left.exr",
                                scratch_.string(), std::getenv("GLASSWING_NUKE_GRAPH")));
    EXPECT_EQ(said.status, 0) << said.text;
    const RadianceImage expected = composite(matte, {back, left}).value();
    const size_t pixels = expected.samples.size() / 3;
    const std::string bytes = read_file(path("out.raw")).value_or("");
    if (bytes.size() != pixels * 4 * sizeof(float)) {
      ADD_FAILURE() << "a picture of " << bytes.size() << " bytes";
      return 0.0;
    }
    std::vector<float> made(pixels * 4);
    std::memcpy(made.data(), bytes.data(), bytes.size());
    double squares = 0.0;
    for (size_t i = 0; i < pixels; ++i) {
      EXPECT_EQ(made[4 * i + 3], matte.coverage(static_cast<int>(i) % matte.width_px(),
                                                static_cast<int>(i) / matte.width_px()));
      for (size_t c = 0; c < 3; ++c)
        squares += std::pow(static_cast<double>(made[4 * i + c] - expected.samples[3 * i + c]), 2);
    }
    return -10.0 * std::log10(squares / static_cast<double>(expected.samples.size()));
  }
};

// Long footprints on two monitors, whose light leaks into the camera's channels.
TEST_F(Nuke, ShowsAllModesAsGlasswingComposites) {
  Matte matte = mixed_matte(kWidth, kHeight);
  const RadianceImage back = picture_of_waves(2 * kWidth, 2 * kHeight),
                      left = picture_of_waves(2 * kWidth, 2 * kHeight);
  EXPECT_GT(psnr_db(matte, back, left), 40.0);
  for (int t = 0; t < 2; ++t) {
    v1::Crosstalk& mix = *matte.metadata.add_crosstalk();
    for (int i = 0; i < 9; ++i) mix.add_share(i % 4 == 0 ? 0.9f : 0.02f * static_cast<float>(i % 3 + t));
  }
  matte.flags(5, 7) = kFlagNoData;
  matte.flags(6, 7) = kFlagNotConverged | kFlagSaturated | kFlagFilled;
  EXPECT_GT(psnr_db(matte, back, left), 40.0);
}

// From points to footprints as wide as the monitor, round and on one monitor only.
TEST_F(Nuke, ShowsAllWidthsOfAColourlessMatte) {
  Matte shape = empty_matte(kWidth, kHeight, 1, 96, 80);
  Matte matte(0, 0, kWidth, kHeight, 1, true);
  matte.metadata = shape.metadata;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float sigma_px = 0.02f * std::exp2(12.0f * static_cast<float>(x) / kWidth);
      matte.modes(x, y, 0)[0] = {.weight = 0.9f,
                                 .x_px = 2.0f * static_cast<float>(x) + 0.3f,
                                 .y_px = 2.0f * static_cast<float>(y) + 0.4f,
                                 .xx_px2 = sigma_px * sigma_px,
                                 .yy_px2 = sigma_px * sigma_px};
    }
  }
  EXPECT_GT(psnr_db(matte, picture_of_waves(96, 80), RadianceImage(96, 80)), 40.0);
  // Nobody looks at the other monitor.
  EXPECT_EQ(read_file(path("vase.nk")).value().find("left_enlarged"), std::string::npos);
}

// A round footprint takes a tap, a long one five.
TEST_F(Nuke, ScriptsAreNoLargerThanTheMatteNeeds) {
  const int
      round = nuke_script(encode_matte(pane()).value(), "pane.exr").value().node_count,
      mixed = nuke_script(encode_matte(mixed_matte(kWidth, kHeight)).value(), "vase.exr").value().node_count;
  EXPECT_LT(round, 110);
  EXPECT_GT(mixed, 2 * round);
}

TEST_F(Nuke, SaysWhatIsWrong) {
  ASSERT_OK(write_file_durably(path("vase.exr"), encode_matte(pane()).value()));
  ASSERT_OK(write_file_durably(path("va[se].exr"), encode_matte(pane()).value()));
  ASSERT_OK(write_file_durably(path("text.exr"), "not a matte"));
  ASSERT_OK(write_file_durably(path("rays.exr"), encode_rays(RayMatte(8, 8, 1)).value()));
  expect_one_line_error(run_glasswing({"nuke", path("vase.exr"), "-o", path("vase.gizmo")}),
                        "must end in .nk");
  expect_one_line_error(run_glasswing({"nuke", path("va[se].exr"), "-o", path("vase.nk")}),
                        "has a special meaning in Nuke scripts");
  expect_one_line_error(run_glasswing({"nuke", path("text.exr"), "-o", path("vase.nk")}), "text.exr");
  expect_one_line_error(run_glasswing({"nuke", path("rays.exr"), "-o", path("vase.nk")}), "contains rays");
  EXPECT_FALSE(std::filesystem::exists(path("vase.nk")));
}

}  // namespace
}  // namespace glasswing
