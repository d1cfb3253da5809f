// A camera and its poses found again from views that other equations made.
#include "core/geometry/geometry_fit.h"

#include <fmt/ranges.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <functional>
#include <map>

#include "core/geometry/rig_geometry.h"
#include "tests/core/geometry/made_views.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using testing::HasSubstr;

struct Made {
  MadeCamera camera;
  MadeMonitor monitor;
  std::vector<MadePose> poses = good_poses();

  std::vector<MonitorView> views(double noise_px, std::uint32_t seed) const {
    std::mt19937 random(seed);
    std::vector<MonitorView> views;
    for (size_t k = 0; k < poses.size(); ++k)
      views.push_back(made_view(camera, monitor, poses[k], "pose" + std::to_string(k), noise_px, random));
    return views;
  }
  absl::StatusOr<GeometryFit> fit(const std::vector<MonitorView>& views) const {
    return fit_geometry(camera.width_px, camera.height_px, views,
                        std::vector<double>(views.size(), monitor.pitch_mm));
  }
};

Eigen::Matrix3d rotation_of(const v1::MonitorPose& pose) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(pose.rotation().data());
}
double turn_deg(const Eigen::Matrix3d& rotation) {
  return Eigen::AngleAxisd(rotation).angle() * 180.0 / std::numbers::pi;
}

void expect_true(const Made& made, const GeometryFit& fit) {
  const v1::CameraGeometry& camera = fit.geometry.camera();
  EXPECT_NEAR(camera.fx_px(), made.camera.fx, 1e-3 * made.camera.fx);
  EXPECT_NEAR(camera.fy_px(), made.camera.fy, 1e-3 * made.camera.fy);
  EXPECT_NEAR(camera.cx_px(), made.camera.cx, 1e-3 * made.camera.width_px);
  EXPECT_NEAR(camera.cy_px(), made.camera.cy, 1e-3 * made.camera.width_px);
  EXPECT_LE(fit.rms_px, 0.1);
  EXPECT_OK(check_geometry(fit.geometry));
  ASSERT_EQ(fit.poses.size(), made.poses.size());
  for (size_t k = 0; k < made.poses.size(); ++k) {
    const v1::MonitorPose& pose = fit.geometry.monitors(static_cast<int>(k));
    const Eigen::Vector3d corner = Eigen::Map<const Eigen::Vector3d>(pose.translation_mm().data());
    const double distance = made.poses[k].middle_mm.norm();
    EXPECT_LE((corner - made.monitor.corner_mm(made.poses[k])).norm(), 1e-3 * distance) << k;
    EXPECT_LE(turn_deg(rotation_of(pose) * made.poses[k].rotation().transpose()), 0.02) << k;
    EXPECT_NEAR(fit.poses[k].distance_mm, distance, 1e-3 * distance);
  }
}

TEST(GeometryFit, FindsCameraAndPoses) {
  const Made made;
  for (const double noise_px : {0.0, 0.01, 0.05}) {
    const absl::StatusOr<GeometryFit> fit = made.fit(made.views(noise_px, 7));
    ASSERT_OK(fit);
    expect_true(made, *fit);
    // Both axes of normal noise.
    EXPECT_NEAR(fit->rms_px, std::sqrt(2.0) * noise_px, 0.1 * noise_px + 1e-6);
    EXPECT_THAT(fit->geometry.warnings(), testing::IsEmpty());
  }
}

// The distortion of the fit is the lens's, wherever the picture shows the monitor, though its numbers trade
// off.
TEST(GeometryFit, FindsStrongDistortionAndAnOffCentre) {
  Made made;
  made.camera = {.fx = 400,
                 .fy = 402,
                 .cx = 290,
                 .cy = 260,
                 .k1 = -0.3,
                 .k2 = 0.12,
                 .p1 = 0.002,
                 .p2 = 0.001,
                 .k3 = -0.02};
  for (MadePose& pose : made.poses) pose.middle_mm *= 0.55;
  const absl::StatusOr<GeometryFit> fit = made.fit(made.views(0.02, 3));
  ASSERT_OK(fit);
  const CameraLens lens(fit->geometry.camera());
  for (double x = -0.6; x <= 0.6; x += 0.1) {
    for (double y = -0.5; y <= 0.5; y += 0.1) {
      const Eigen::Vector2d truth = made.camera.pixel_of({x, y, 1.0});
      if (truth.x() < 20 || truth.x() > 620 || truth.y() < 20 || truth.y() > 460) continue;
      EXPECT_LE((lens.pixel_of({x, y}) - truth).norm(), 0.3) << x << " " << y;
    }
  }
}

// What the standard errors claim is what repeats with other noise scatter by. Of 50 repeats a standard
// deviation is known to 10 %; three times that on either side, and the estimate's own share.
TEST(GeometryFit, StandardErrorsAreTheScatterOfRepeats) {
  const Made made;
  constexpr int kRepeats = 50;
  struct Number {
    double sum = 0.0, squares = 0.0, variance = 0.0;
    void add(double value, double sd) {
      sum += value / kRepeats;
      squares += value * value / kRepeats;
      variance += sd * sd / kRepeats;
    }
    double scatter() const { return std::sqrt((squares - sum * sum) * kRepeats / (kRepeats - 1)); }
  };
  std::map<std::string, Number> numbers;
  for (std::uint32_t repeat = 0; repeat < kRepeats; ++repeat) {
    const absl::StatusOr<GeometryFit> fit = made.fit(made.views(0.03, 100 + repeat));
    ASSERT_OK(fit);
    const v1::CameraGeometry& camera = fit->geometry.camera();
    numbers["fx"].add(camera.fx_px() - made.camera.fx, camera.sd(kFx));
    numbers["fy"].add(camera.fy_px() - made.camera.fy, camera.sd(kFy));
    numbers["cx"].add(camera.cx_px() - made.camera.cx, camera.sd(kCx));
    numbers["cy"].add(camera.cy_px() - made.camera.cy, camera.sd(kCy));
    numbers["k1"].add(camera.k1() - made.camera.k1, camera.sd(kK1));
    numbers["p1"].add(camera.p1() - made.camera.p1, camera.sd(kP1));
    for (const int k : {0, 5}) {
      const std::string pose = "pose" + std::to_string(k);
      const PoseFit& own = fit->poses[k];
      const MadePose& truth = made.poses[k];
      numbers[pose + " distance"].add(own.distance_mm - truth.middle_mm.norm(), own.distance_sd_mm);
      const v1::MonitorPose& found = fit->geometry.monitors(k);
      const Eigen::Matrix3d turn = rotation_of(found) * truth.rotation().transpose();
      numbers[pose + " turn about x"].add(0.5 * (turn(2, 1) - turn(1, 2)), std::sqrt(found.covariance(0)));
      numbers[pose + " turn about z"].add(0.5 * (turn(1, 0) - turn(0, 1)), std::sqrt(found.covariance(14)));
      numbers[pose + " x"].add(found.translation_mm(0) - made.monitor.corner_mm(truth).x(),
                               std::sqrt(found.covariance(21)));
    }
  }
  for (const auto& [name, number] : numbers) {
    const double claimed = std::sqrt(number.variance);
    EXPECT_GT(number.scatter() / claimed, 0.65) << name;
    EXPECT_LT(number.scatter() / claimed, 1.35) << name;
    EXPECT_LT(std::abs(number.sum), 4.0 * claimed / std::sqrt(kRepeats)) << name << " is biased";
  }
}

// The focal length's rms error over its standard error, of fits to views that `spoil` makes noisy; NaN if one
// fails.
double focal_error_in_sd(const std::function<void(MonitorView&, std::mt19937&)>& spoil) {
  const Made made;
  constexpr int kRepeats = 20;
  double squares = 0.0, variance = 0.0;
  for (std::uint32_t repeat = 0; repeat < kRepeats; ++repeat) {
    std::vector<MonitorView> views = made.views(0.0, 1);
    std::mt19937 random(repeat);
    for (MonitorView& view : views) spoil(view, random);
    const absl::StatusOr<GeometryFit> fit = made.fit(views);
    EXPECT_OK(fit);
    if (!fit.ok()) return NAN;
    const v1::CameraGeometry& camera = fit->geometry.camera();
    squares += std::pow(camera.fx_px() - made.camera.fx, 2.0) / kRepeats;
    variance += std::pow(camera.sd(kFx), 2.0) / kRepeats;
  }
  return std::sqrt(squares / variance);
}

// Noise that neighbours share makes the result worse than the number of points says.
TEST(GeometryFit, StandardErrorsCountNoiseThatNeighboursShare) {
  const double error = focal_error_in_sd([](MonitorView& view, std::mt19937& random) {
    std::normal_distribution<double> normal(0.0, 0.05);
    std::map<std::pair<int, int>, Eigen::Vector2d> shared;  // by a sixteenth of the picture's width
    for (Sighting& sighting : view.sightings) {
      const auto [place, is_new] = shared.try_emplace(
          {static_cast<int>(sighting.pixel.x() / 40), static_cast<int>(sighting.pixel.y() / 40)});
      if (is_new) place->second = {normal(random), normal(random)};
      sighting.pixel += place->second;
    }
  });
  EXPECT_LT(error, 1.6);
  EXPECT_GT(error, 0.5);
}

// Points on smooth maps err together, by a polynomial of the picture that most of the fit cannot tell from a
// pose.
TEST(GeometryFit, StandardErrorsCountWhatSmoothMapsErrBy) {
  const double error = focal_error_in_sd([](MonitorView& view, std::mt19937& random) {
    std::normal_distribution<double> normal(0.0, 0.01);
    std::array<Eigen::Vector2d, 15> terms;
    for (Eigen::Vector2d& term : terms) term = {normal(random), normal(random)};
    for (Sighting& sighting : view.sightings) {
      const double x = sighting.pixel.x() / 320 - 1, y = sighting.pixel.y() / 240 - 1;
      size_t term = 0;
      for (int i = 0; i <= 4; ++i) {
        for (int j = 0; i + j <= 4; ++j)
          sighting.pixel += std::cos(i * std::acos(std::clamp(x, -1.0, 1.0))) *
                            std::cos(j * std::acos(std::clamp(y, -1.0, 1.0))) * terms[term++];
      }
      sighting.sd_px = 0.0;
    }
  });
  EXPECT_LT(error, 2.0);
  EXPECT_GT(error, 0.3);
}

TEST(GeometryFit, LeavesOutWhatLiesFarOff) {
  const Made made;
  std::vector<MonitorView> views = made.views(0.02, 5);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> anywhere(0.0, 400.0);
  int wrong = 0;
  for (size_t i = 0; i < views[2].sightings.size(); i += 10, ++wrong)
    views[2].sightings[i].pixel = {anywhere(random), anywhere(random)};
  const absl::StatusOr<GeometryFit> fit = made.fit(views);
  ASSERT_OK(fit);
  expect_true(made, *fit);
  EXPECT_GE(fit->poses[2].left_out, wrong - 2);
  ASSERT_EQ(fit->geometry.warnings_size(), 1);
  EXPECT_THAT(fit->geometry.warnings(0), HasSubstr("points of pose \"pose2\" are outliers"));
}

TEST(GeometryFit, RefusesParallelPoses) {
  for (const double noise_px : {0.0, 0.02}) {
    for (const double tilt_deg : {0.0, 12.0}) {
      Made made;
      made.poses.clear();
      for (const double distance : {480.0, 520.0, 570.0, 640.0, 700.0})
        made.poses.push_back({tilt_deg, 0, 0, {0.05 * distance, 0, distance}});
      const absl::StatusOr<GeometryFit> fit = made.fit(made.views(noise_px, 2));
      ASSERT_FALSE(fit.ok()) << noise_px << " " << tilt_deg << " " << fit->geometry.camera().fx_px();
      EXPECT_THAT(std::string(fit.status().message()), HasSubstr("all poses are parallel within 0."))
          << tilt_deg;
      EXPECT_THAT(std::string(fit.status().message()), HasSubstr("20 to 40 degrees"));
    }
  }
}

TEST(GeometryFit, SaysWhatIsWeak) {
  const auto warnings_of = [](const Made& made) {
    const absl::StatusOr<GeometryFit> fit = made.fit(made.views(0.02, 4));
    EXPECT_OK(fit);
    return fit.ok() ? fmt::format("{}", fmt::join(fit->geometry.warnings(), "\n")) : "";
  };
  Made made;
  made.poses = {{0, 0, 0, {0, 0, 520}}, {25, 0, 0, {0, 0, 560}}, {-25, 0, 0, {0, 0, 540}}};
  EXPECT_THAT(warnings_of(made), HasSubstr("turn about only one axis"));
  EXPECT_THAT(warnings_of(made), HasSubstr("there are 3 poses"));
  made.poses = {
      {0, 0, 0, {0, 0, 520}}, {8, 0, 0, {0, 0, 560}}, {-4, 5, 0, {0, 0, 540}}, {-4, -5, 0, {0, 0, 500}}};
  EXPECT_THAT(warnings_of(made), HasSubstr("degrees, which couples focal length and distance"));
  made.poses = good_poses();
  for (MadePose& pose : made.poses) pose.middle_mm += Eigen::Vector3d(-330, 0, 400);
  EXPECT_THAT(warnings_of(made),
              testing::ContainsRegex("no pose covers these parts of the picture: .*top right.*, right"));
}

TEST(GeometryFit, RefusesFewOrMirroredViews) {
  Made made;
  made.poses.resize(2);
  EXPECT_THAT(std::string(made.fit(made.views(0.0, 1)).status().message()),
              HasSubstr("there are 2 poses; a lens needs at least 3"));
  made.poses = good_poses();
  std::vector<MonitorView> views = made.views(0.0, 1);
  views[1].session = views[0].session;
  EXPECT_THAT(std::string(made.fit(views).status().message()),
              HasSubstr("two mattes are from session \"pose0\""));
  views = made.views(0.0, 1);
  for (Sighting& sighting : views[3].sightings) sighting.monitor_px.x() = 1920 - sighting.monitor_px.x();
  EXPECT_THAT(std::string(made.fit(views).status().message()),
              HasSubstr("pose \"pose3\" sees monitor back mirrored"));
}

}  // namespace
}  // namespace glasswing
