// Mattes of glass by Snell's law before monitors at two depths: the rays are those of the law.
#include "core/rays/match_rays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>
#include <vector>

#include "tests/core/rays/snell.h"

namespace glasswing {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using snell::Line;

constexpr int kWidth = 80, kHeight = 60, kMonitorWidth = 128, kMonitorHeight = 96;
constexpr double kFocal = 125.0, kNear = 200.0, kFar = 251.2, kBetween = 225.6;

v1::RigGeometry geometry() {
  v1::RigGeometry made;
  v1::CameraGeometry& camera = *made.mutable_camera();
  camera.set_width_px(kWidth);
  camera.set_height_px(kHeight);
  camera.set_fx_px(kFocal);
  camera.set_fy_px(kFocal);
  camera.set_cx_px(0.5 * kWidth);
  camera.set_cy_px(0.5 * kHeight);
  for (const auto& [name, depth] : {std::pair{"near", kNear}, {"far", kFar}, {"between", kBetween}}) {
    v1::MonitorPose& pose = *made.add_monitors();
    pose.set_name(name);
    pose.set_width_px(kMonitorWidth);
    pose.set_height_px(kMonitorHeight);
    pose.set_pitch_mm(1.0);
    for (const double r : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) pose.add_rotation(r);
    for (const double t : {-0.5 * kMonitorWidth, -0.5 * kMonitorHeight, depth}) pose.add_translation_mm(t);
  }
  return made;
}

Vector3d camera_direction(double x, double y) {
  return Vector3d((x - 0.5 * kWidth) / kFocal, (y - 0.5 * kHeight) / kFocal, 1.0).normalized();
}

using Trace = std::function<std::optional<Line>(const Line&)>;

struct Seen {
  Vector2d at;
  Matrix2d covariance;
};
// The footprint of a pixel on the monitor at a depth, by differences; none off the monitor or the object.
std::optional<Seen> seen(const Trace& trace, int x, int y, double depth, bool anywhere = false) {
  const auto at = [&](double px, double py) -> std::optional<Vector2d> {
    const auto line = trace({Vector3d::Zero(), camera_direction(px, py)});
    if (!line || line->direction.z() < 0.05) return std::nullopt;
    const Vector3d hit = snell::at_depth(*line, depth);
    return Vector2d(hit.x() + 0.5 * kMonitorWidth, hit.y() + 0.5 * kMonitorHeight);
  };
  constexpr double kStep = 0.05;
  const double px = x + 0.5, py = y + 0.5;
  const auto middle = at(px, py), right = at(px + kStep, py), left = at(px - kStep, py),
             down = at(px, py + kStep), up = at(px, py - kStep);
  if (!middle || !right || !left || !down || !up) return std::nullopt;
  const bool on =
      middle->x() > 0 && middle->x() < kMonitorWidth && middle->y() > 0 && middle->y() < kMonitorHeight;
  if (!on && !anywhere) return std::nullopt;
  Matrix2d slope;
  slope << (*right - *left) / (2 * kStep), (*down - *up) / (2 * kStep);
  return Seen{*middle, slope * slope.transpose() / 12.0};
}

Matte matte_of(const Trace& trace, double depth) {
  Matte matte(0, 0, kWidth, kHeight, 2);
  matte.metadata.set_width_px(kWidth);
  matte.metadata.set_height_px(kHeight);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(kMonitorWidth);
  monitor.set_height_px(kMonitorHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (!trace({Vector3d::Zero(), camera_direction(x + 0.5, y + 0.5)})) continue;
      matte.coverage(x, y) = 1.0f;
      const auto footprint = seen(trace, x, y, depth);
      if (!footprint) continue;
      for (int c = 0; c < kChannels; ++c) {
        // A faint path of its own, the same in both mattes but for its place, as a reflection would be.
        matte.modes(x, y, c)[0] = {.weight = 0.9f,
                                   .x_px = static_cast<float>(footprint->at.x()),
                                   .y_px = static_cast<float>(footprint->at.y()),
                                   .xx_px2 = static_cast<float>(footprint->covariance(0, 0)),
                                   .xy_px2 = static_cast<float>(footprint->covariance(0, 1)),
                                   .yy_px2 = static_cast<float>(footprint->covariance(1, 1))};
        matte.modes(x, y, c)[1] = {.weight = 0.05f,
                                   .x_px = static_cast<float>(100.0 - 0.05 * (depth - kNear)),
                                   .y_px = 20.0f,
                                   .xx_px2 = 1.0f,
                                   .xy_px2 = 0.0f,
                                   .yy_px2 = 1.0f};
      }
    }
  }
  return matte;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values.at(values.size() / 2);
}

TEST(MatchRays, SphereObeysSnellsLaw) {
  const Trace trace = [](const Line& in) { return snell::through_sphere(in, {-4.0, 3.0, 150.0}, 24.0, 1.5); };
  const v1::RigGeometry rig = geometry();
  const RayMatte rays =
      match_rays(matte_of(trace, kNear), matte_of(trace, kFar), rig, {"near", "far"}).value();
  const MonitorPlane between(rig.monitors(2));
  std::vector<double> turned, off, spread, extrapolated;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto law = trace({Vector3d::Zero(), camera_direction(x + 0.5, y + 0.5)});
      if (!law) continue;
      const bool near = seen(trace, x, y, kNear).has_value(), far = seen(trace, x, y, kFar).has_value();
      const Ray& ray = rays.rays(x, y, 1)[0];
      if (!near) continue;
      EXPECT_FLOAT_EQ(ray.weight, 0.9f) << x << ", " << y;
      const double angle = snell::degrees_between(ray.direction.cast<double>(), law->direction);
      if (!far) {
        // Never taken for one that was measured.
        EXPECT_TRUE(ray.state == RayState::kExtrapolated || ray.state == RayState::kUnknown)
            << x << ", " << y;
        if (ray.state == RayState::kExtrapolated) extrapolated.push_back(angle);
        continue;
      }
      EXPECT_EQ(ray.state, RayState::kMatched) << x << ", " << y;
      turned.push_back(angle);
      PlaneFootprint footprint;
      ASSERT_TRUE(meet_plane(ray, between, 0.0, footprint));
      const Seen truth = *seen(trace, x, y, kBetween, true);
      off.push_back((footprint.centre_px - truth.at).norm());
      spread.push_back((footprint.covariance_px2 - truth.covariance).norm() / truth.covariance.norm());
    }
  }
  ASSERT_GT(turned.size(), 500u);
  EXPECT_LT(*std::ranges::max_element(turned), 1e-3);
  EXPECT_LT(*std::ranges::max_element(off), 1e-3);
  EXPECT_LT(median(spread), 0.02);
  ASSERT_GT(extrapolated.size(), 20u);
  EXPECT_LT(median(extrapolated), 5.0);
}

TEST(MatchRays, SlabShiftsRaysAndDoesNotTurnThem) {
  const Vector3d normal = Vector3d(0.35, -0.1, 1.0).normalized();
  const Trace trace = [&](const Line& in) -> std::optional<Line> {
    return snell::through_slab(in, {0.0, 0.0, 120.0}, normal, 25.0, 1.52);
  };
  const RayMatte rays =
      match_rays(matte_of(trace, kFar), matte_of(trace, kNear), geometry(), {"far", "near"}).value();
  EXPECT_EQ(rays.metadata.poses(0), "near");
  int count = 0;
  double shift = 0.0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (!seen(trace, x, y, kFar)) continue;
      const Ray& ray = rays.rays(x, y, 0)[0];
      const Vector3d straight = camera_direction(x + 0.5, y + 0.5);
      EXPECT_LT(snell::degrees_between(ray.direction.cast<double>(), straight), 1e-3);
      // On the line by the law, which the camera's own ray is not.
      const Line law = *trace({Vector3d::Zero(), straight});
      const Vector3d origin = ray.origin_mm.cast<double>();
      EXPECT_LT((origin - law.origin).cross(law.direction).norm(), 1e-3);
      shift = std::max(shift, origin.cross(straight).norm());
      ++count;
    }
  }
  EXPECT_GT(count, 3000);
  EXPECT_GT(shift, 1.0);
}

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Two turned poses before a camera of few pixels, and roots of the covariances that their poses have.
class UncertainRig {
 public:
  static constexpr int kSide = 4;

  UncertainRig() : rig_(geometry()) {
    rig_.mutable_camera()->set_width_px(kSide);
    rig_.mutable_camera()->set_height_px(kSide);
    for (int pose = 0; pose < 2; ++pose) {
      // About 0.1 degrees and 0.1 mm, with correlations.
      Matrix6d root;
      for (double& number : root.reshaped()) number = 0.5 * normal_(random_);
      root += Matrix6d::Identity();
      root.topRows<3>() *= 2e-3;
      root.bottomRows<3>() *= 0.1;
      roots_.push_back(root);
      turns_.push_back(
          (Eigen::AngleAxisd(0.3 - 0.2 * pose, Vector3d::UnitY()) * Eigen::AngleAxisd(0.2, Vector3d::UnitX()))
              .toRotationMatrix());
      v1::MonitorPose& own = *rig_.mutable_monitors(pose);
      for (int i = 0; i < 9; ++i) own.set_rotation(i, turns_.back()(i / 3, i % 3));
      const Matrix6d covariance = root * root.transpose();
      for (const double number : covariance.reshaped()) own.add_covariance(number);
    }
  }
  const v1::RigGeometry& mean() const { return rig_; }
  // One of the rigs that the calibration may have been of.
  v1::RigGeometry drawn() {
    v1::RigGeometry drawn = rig_;
    for (int pose = 0; pose < 2; ++pose) {
      Vector6d error;
      for (double& number : error) number = normal_(random_);
      error = roots_[pose] * error;
      const Vector3d turn = error.head<3>();
      const Eigen::Matrix3d turned =
          Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix() * turns_[pose];
      v1::MonitorPose& own = *drawn.mutable_monitors(pose);
      for (int i = 0; i < 9; ++i) own.set_rotation(i, turned(i / 3, i % 3));
      for (int i = 0; i < 3; ++i) own.set_translation_mm(i, own.translation_mm(i) + error[3 + i]);
    }
    return drawn;
  }

 private:
  std::mt19937 random_{7};
  std::normal_distribution<double> normal_;
  v1::RigGeometry rig_;
  std::vector<Matrix6d> roots_;
  std::vector<Eigen::Matrix3d> turns_;
};

// Places that are known far better than the poses are, spread over the monitor.
Matte sure_matte(int side, double bent) {
  Matte made(0, 0, side, side, 1);
  v1::Monitor& monitor = *made.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(kMonitorWidth);
  monitor.set_height_px(kMonitorHeight);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      made.coverage(x, y) = 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        made.modes(x, y, c)[0] = {.weight = 0.9f,
                                  .x_px = static_cast<float>(20.0 + (20.0 + bent) * x),
                                  .y_px = static_cast<float>(15.0 + (15.0 - 0.5 * bent) * y + 2.0 * bent),
                                  .xx_px2 = 1.0f,
                                  .yy_px2 = 1.0f,
                                  .centre_sd_px = 1e-4f};
      }
    }
  }
  return made;
}

// Poses are drawn from the covariances of a calibration; rays must scatter as their standard errors say.
TEST(MatchRays, StandardErrorsHaveThoseOfThePoses) {
  constexpr int kSide = UncertainRig::kSide, kDraws = 2000;
  UncertainRig rig;
  const Matte near = sure_matte(kSide, 0.0), far = sure_matte(kSide, 4.0);
  const std::vector<std::string> poses = {"near", "far"};
  const RayMatte rays = match_rays(near, far, rig.mean(), poses).value();
  std::vector<double> origins(kSide * kSide), directions(kSide * kSide);
  for (int draw = 0; draw < kDraws; ++draw) {
    const RayMatte moved = match_rays(near, far, rig.drawn(), poses).value();
    for (size_t i = 0; i < origins.size(); ++i) {
      const int x = static_cast<int>(i) % kSide, y = static_cast<int>(i) / kSide;
      const Ray &mean = rays.rays(x, y, 1)[0], &ray = moved.rays(x, y, 1)[0];
      const auto across = [&](const Eigen::Vector3f& to, const Eigen::Vector3f& from) {
        const Vector3d direction = mean.direction.cast<double>(),
                       by = to.cast<double>() - from.cast<double>();
        return 0.5 * (by - direction * direction.dot(by)).squaredNorm() / kDraws;
      };
      origins[i] += across(ray.origin_mm, mean.origin_mm);
      directions[i] += across(ray.direction, mean.direction);
    }
  }
  // Four standard deviations of the scatter of 2000 draws along one axis are 6 %.
  for (size_t i = 0; i < origins.size(); ++i) {
    const Ray& ray = rays.rays(static_cast<int>(i) % kSide, static_cast<int>(i) / kSide, 1)[0];
    ASSERT_EQ(ray.state, RayState::kMatched);
    EXPECT_NEAR(std::sqrt(origins[i]) / static_cast<double>(ray.origin_sd_mm), 1.0, 0.06);
    EXPECT_NEAR(std::sqrt(directions[i]) / static_cast<double>(ray.direction_sd), 1.0, 0.06);
  }
}

TEST(MatchRays, LightOfOneDepthIsLabelled) {
  const Trace trace = [](const Line& in) { return snell::through_sphere(in, {0.0, 0.0, 150.0}, 24.0, 1.5); };
  const RayMatte rays = far_light_rays(matte_of(trace, kNear), geometry(), "near", 150.0).value();
  EXPECT_NE(rays.metadata.approximation().find("far environment"), std::string::npos);
  const Ray& ray = rays.rays(kWidth / 2, kHeight / 2, 1)[0];
  EXPECT_EQ(ray.state, RayState::kFarLight);
  EXPECT_NEAR(static_cast<double>(ray.origin_mm.z()), 150.0, 1e-3);
  EXPECT_EQ(rays.rays(0, 0, 1)[0].state, RayState::kStraight);
  EXPECT_FALSE(far_light_rays(matte_of(trace, kNear), geometry(), "near", 0.0).ok());
}

TEST(MatchRays, RefusesWhatCannotBeMatched) {
  const Trace trace = [](const Line& in) { return snell::through_sphere(in, {0.0, 0.0, 150.0}, 24.0, 1.5); };
  const Matte matte = matte_of(trace, kNear);
  const auto message = [&](const std::vector<std::string>& poses) {
    return std::string(match_rays(matte, matte, geometry(), poses).status().message());
  };
  EXPECT_NE(message({"near", "nowhere"}).find("it has: near, far, between"), std::string::npos);
  EXPECT_NE(message({"near", "near"}).find("more than 0.2 mm apart"), std::string::npos)
      << message({"near", "near"});
  v1::RigGeometry other = geometry();
  other.mutable_camera()->set_width_px(kWidth + 1);
  EXPECT_FALSE(match_rays(matte, matte, other, {"near", "far"}).ok());
}

TEST(RigGeometry, TextIsReadAsWritten) {
  v1::RigGeometry rig = geometry();
  rig.mutable_camera()->set_k1(-0.06);
  const v1::RigGeometry read = parse_geometry(geometry_text(rig), "rig.txtpb").value();
  EXPECT_EQ(read.SerializeAsString(), rig.SerializeAsString());
  v1::RigGeometry short_of = rig;
  short_of.mutable_monitors(0)->add_covariance(1.0);
  EXPECT_NE(std::string(parse_geometry(geometry_text(short_of), "rig.txtpb").status().message())
                .find("1 numbers of covariance"),
            std::string::npos);
  rig.mutable_monitors(0)->set_rotation(0, 0.9);
  EXPECT_NE(
      std::string(parse_geometry(geometry_text(rig), "rig.txtpb").status().message()).find("pose \"near\""),
      std::string::npos);
  EXPECT_NE(std::string(parse_geometry("camera {\n fx: 1 }", "rig.txtpb").status().message()).find("line 2"),
            std::string::npos);
}

TEST(CameraLens, DistortionIsInverted) {
  v1::CameraGeometry camera = geometry().camera();
  camera.set_k1(-0.06);
  camera.set_k2(0.01);
  camera.set_p1(0.002);
  camera.set_p2(-0.001);
  const CameraLens lens(camera);
  for (const Vector2d& pixel : {Vector2d(0.0, 0.0), Vector2d(80.0, 60.0), Vector2d(13.5, 41.5)})
    EXPECT_LT((lens.pixel_of(lens.slope_of(pixel)) - pixel).norm(), 1e-9);
  // By hand: u = (0.1, 0), d = 0.1 (1 - 0.06 0.01 + 0.01 0.0001) - 0.001 (0.01 + 0.02).
  const double d = 0.1 * (1.0 - 0.0006 + 0.000001) - 0.001 * 0.03;
  EXPECT_NEAR(lens.pixel_of({0.1, 0.0}).x(), kFocal * d + 0.5 * kWidth, 1e-9);
}

}  // namespace
}  // namespace glasswing
