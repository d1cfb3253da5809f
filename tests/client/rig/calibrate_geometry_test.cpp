// glasswing calibrate geometry, of mattes of a stage that other equations made; glasswing rays reads its
// file.
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/geometry/rig_geometry.h"
#include "core/matte/matte_file.h"
#include "tests/client/run_glasswing.h"
#include "tests/core/geometry/made_views.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

class CalibrateGeometry : public ScratchTest {
 protected:
  CalibrateGeometry() {
    camera_ = {.fx = 103, .fy = 102, .cx = 41, .cy = 29, .width_px = 80, .height_px = 60};
    const std::vector<MadePose> poses = good_poses();
    for (size_t k = 0; k < poses.size(); ++k) write("tilt" + std::to_string(k), poses[k]);
  }
  std::string path(const std::string& name) const { return (scratch_ / name).string(); }
  std::vector<std::string> command(std::vector<std::string> files) const {
    std::vector<std::string> words = {"--json", "calibrate", "geometry"};
    for (const std::string& file : files) words.push_back(path(file));
    words.insert(words.end(), {"--pitch-mm", "back:0.2745", "-o", path("rig.txtpb")});
    return words;
  }
  // A pixel that sees the monitor's edge or past it has no mode.
  void write(const std::string& name, const MadePose& pose) const {
    Matte matte(0, 0, camera_.width_px, camera_.height_px, 1);
    matte.metadata.set_format_version(1);
    matte.metadata.set_session(name);
    matte.metadata.set_width_px(camera_.width_px);
    matte.metadata.set_height_px(camera_.height_px);
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(monitor_.width_px);
    monitor.set_height_px(monitor_.height_px);
    for (int y = 0; y < camera_.height_px; ++y) {
      for (int x = 0; x < camera_.width_px; ++x) {
        const Eigen::Vector2d at = looked_at(camera_, monitor_, pose, {x + 0.5, y + 0.5});
        if (at.x() < 0 || at.y() < 0 || at.x() > monitor_.width_px || at.y() > monitor_.height_px) continue;
        for (int c = 0; c < kChannels; ++c) {
          matte.modes(x, y, c)[0] = {.weight = 0.8f,
                                     .x_px = static_cast<float>(at.x()),
                                     .y_px = static_cast<float>(at.y()),
                                     .xx_px2 = 9.0f,
                                     .yy_px2 = 9.0f};
        }
      }
    }
    ASSERT_OK(write_file_durably(path(name + ".exr"), encode_matte(matte).value()));
  }

  MadeCamera camera_;
  const MadeMonitor monitor_;
};

TEST_F(CalibrateGeometry, WritesWhatRaysReads) {
  std::vector<std::string> files;
  for (int k = 0; k < 8; ++k) files.push_back("tilt" + std::to_string(k) + ".exr");
  const Outcome made = run_glasswing(command(files));
  ASSERT_EQ(made.status, 0) << made.err;
  const auto json = nlohmann::json::parse(made.out);
  EXPECT_NEAR(json["fx_px"].get<double>(), camera_.fx, 0.01);
  EXPECT_LT(json["rms_px"].get<double>(), 0.001);
  EXPECT_EQ(json["poses"].size(), 8u);
  const v1::RigGeometry geometry = read_geometry(path("rig.txtpb")).value();
  EXPECT_NEAR(geometry.camera().fy_px(), camera_.fy, 0.01);
  EXPECT_NEAR(geometry.camera().cx_px(), camera_.cx, 0.01);
  EXPECT_NEAR(geometry.camera().k1(), camera_.k1, 1e-3);
  EXPECT_EQ(geometry.monitors(3).name(), "tilt3");
  const Eigen::Vector3d corner = monitor_.corner_mm(good_poses()[3]);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(geometry.monitors(3).translation_mm(i), corner[i], 0.05);
  EXPECT_EQ(geometry.monitors(3).covariance_size(), 36);

  const Outcome rays = run_glasswing({"rays", path("tilt0.exr"), path("tilt5.exr"), "--geometry",
                                      path("rig.txtpb"), "-o", path("rays.exr")});
  EXPECT_EQ(rays.status, 0) << rays.err;
}

TEST_F(CalibrateGeometry, RefusesWhatIsMissing) {
  expect_one_line_error(run_glasswing(command({"tilt0.exr", "tilt1.exr"})),
                        "there are 2 poses; a lens needs at least 3");
  expect_one_line_error(run_glasswing({"calibrate", "geometry", path("tilt0.exr"), "--pitch-mm", "side:0.3",
                                       "-o", path("rig.txtpb")}),
                        "add --pitch-mm back:MM");
  expect_one_line_error(run_glasswing({"calibrate", "geometry", path("tilt0.exr"), "--pitch-mm", "back:-1",
                                       "-o", path("rig.txtpb")}),
                        "--pitch-mm is \"back:-1\"; it must be a number in (0, 100]");
  EXPECT_FALSE(std::filesystem::exists(path("rig.txtpb")));
}

}  // namespace
}  // namespace glasswing
