// glasswing rays, and glasswing composite of what it wrote.
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "tests/compositing/run_glasswing.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kSide = 16;
constexpr double kNear_mm = 100.0, kFar_mm = 150.0;

class Rays : public ScratchTest {
 protected:
  Rays() {
    write("near", kNear_mm);
    write("far", kFar_mm);
    std::ofstream rig(scratch_ / "rig.txtpb");
    rig << "camera { width_px: 16 height_px: 16 fx_px: 16 fy_px: 16 cx_px: 8 cy_px: 8 }\n";
    for (const auto& [name, depth] : {std::pair{"near", kNear_mm}, {"far", kFar_mm}}) {
      rig << "monitors { name: \"" << name << "\" width_px: 200 height_px: 200 pitch_mm: 1 "
          << "rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1] translation_mm: [-100, -100, " << depth << "] }\n";
    }
  }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  // A pane that turns nothing: every pixel sees what lies straight behind it, less a fifth of the light.
  void write(const std::string& name, double depth) const {
    Matte matte(0, 0, kSide, kSide, 1);
    matte.metadata.set_format_version(1);
    matte.metadata.set_session(name);
    matte.metadata.set_width_px(kSide);
    matte.metadata.set_height_px(kSide);
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(200);
    monitor.set_height_px(200);
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x) {
        matte.coverage(x, y) = x < 4 ? 0.5f : 1.0f;
        for (int c = 0; c < kChannels; ++c) {
          matte.modes(x, y, c)[0] = {.weight = 0.8f,
                                     .x_px = static_cast<float>(100.0 + (x + 0.5 - 8.0) / 16.0 * depth),
                                     .y_px = static_cast<float>(100.0 + (y + 0.5 - 8.0) / 16.0 * depth),
                                     .xx_px2 = 1.0f,
                                     .yy_px2 = 1.0f};
        }
      }
    }
    ASSERT_OK(write_file_durably(path(name + ".exr"), encode_matte(matte).value()));
  }
};

TEST_F(Rays, AreWrittenAndComposited) {
  const Outcome made = run_glasswing({"--json", "rays", path("near.exr"), path("far.exr"), "--geometry",
                                      path("rig.txtpb"), "-o", path("rays.exr")});
  ASSERT_EQ(made.status, 0) << made.err;
  const auto json = nlohmann::json::parse(made.out);
  EXPECT_EQ(json["matched"], 3 * kSide * kSide);
  EXPECT_EQ(json["extrapolated"], 0);
  RadianceImage sky(64, 32), picture(200, 200);
  std::ranges::fill(sky.samples, 0.5f);
  std::ranges::fill(picture.samples, 0.25f);
  ASSERT_OK(write_radiance(path("sky.exr"), sky, Encoding::kLinear));
  ASSERT_OK(write_radiance(path("picture.exr"), picture, Encoding::kLinear));
  // The plane at 400 mm is as large as the monitor: 100 mm to either side, a quarter of its depth, so that
  // pixels within 4 px of the middle see it.
  const Outcome over = run_glasswing({"composite", path("rays.exr"), "--plane", "400:" + path("picture.exr"),
                                      "--environment", path("sky.exr"), "-o", path("out.exr")});
  ASSERT_EQ(over.status, 0) << over.err;
  const RadianceImage out = read_radiance(path("out.exr"), Encoding::kLinear).value();
  EXPECT_NEAR(out.at(8, 8, 1), 0.8f * 0.25f, 2e-3f);
  EXPECT_NEAR(out.at(1, 8, 1), 0.8f * 0.5f, 2e-3f);

  // The object alone is the same light times the mattes' coverage.
  const Outcome alone =
      run_glasswing({"composite", path("rays.exr"), "--plane", "400:" + path("picture.exr"), "--environment",
                     path("sky.exr"), "-o", path("object.exr"), "--object"});
  ASSERT_EQ(alone.status, 0) << alone.err;
  const RadianceImage object = read_radiance(path("object.exr"), Encoding::kLinear).value();
  for (int y = 0; y < out.height_px; ++y) {
    for (int x = 0; x < out.width_px; ++x) {
      EXPECT_EQ(object.at(x, y, 1), (x < 4 ? 0.5f : 1.0f) * out.at(x, y, 1));
    }
  }
}

TEST_F(Rays, ErrorsSayWhatIsWrong) {
  const std::string rig = path("rig.txtpb"), out = path("rays.exr");
  expect_one_line_error(run_glasswing({"rays", path("near.exr"), "--geometry", rig, "-o", out}),
                        "--object-depth");
  expect_one_line_error(run_glasswing({"rays", path("near.exr"), path("far.exr"), "--geometry", rig,
                                       "--poses", "near,up", "-o", out}),
                        "\"up\"");
  expect_one_line_error(
      run_glasswing({"composite", path("near.exr"), "--environment", "sky.exr", "-o", path("a.exr")}),
      "--environment");
  expect_one_line_error(run_glasswing({"composite", path("near.exr"), "-o", path("a.exr")}), "--background");
  ASSERT_EQ(run_glasswing({"rays", path("near.exr"), path("far.exr"), "--geometry", rig, "-o", out}).status,
            0);
  expect_one_line_error(run_glasswing({"composite", out, "--plane", "near:a.png", "-o", path("a.exr")}),
                        "850:harbour.png");
  expect_one_line_error(run_glasswing({"composite", out, "-o", path("a.exr")}), "--plane");
}

}  // namespace
}  // namespace glasswing
