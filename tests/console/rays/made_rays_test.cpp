#include "console/rays/made_rays.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "core/rays/ray_file.h"
#include "tests/console/rays/straight_mattes.h"

namespace glasswing {
namespace {

using Eigen::Vector3d;
using nlohmann::json;

class MadeRays : public testing::Test {
 protected:
  std::array<RayDepth, 2> depths() const {
    return {RayDepth{"first", "near", near_}, RayDepth{"second", "far", far_}};
  }

  const v1::RigGeometry geometry_ = geometry_in(kStraightGeometry).value();
  std::string near_ = straight_matte("first", 200.0), far_ = straight_matte("second", 250.0);
};

TEST_F(MadeRays, GoThroughTheCameraWhereNothingBendsThem) {
  const std::string answer = rays_to_play(geometry_, depths(), {}, false).value();
  const size_t end = answer.find('\n');
  const json told = json::parse(answer.substr(0, end));
  constexpr int kPixels = kStraightWidth * kStraightHeight;
  EXPECT_EQ(told["counts"]["matched"]["rays"], 3 * kPixels);
  EXPECT_NEAR(told["counts"]["matched"]["light"].get<double>(), 3 * 0.8 * kPixels, 1e-3);
  for (const char* none : {"ambiguous", "extrapolated", "unknown"})
    EXPECT_EQ(told["counts"][none]["rays"], 0);
  EXPECT_EQ(told["poses"], json({"near", "far"}));
  ASSERT_EQ(told["sampled"].size(), kPixels);
  for (const json& ray : told["sampled"]) {
    EXPECT_EQ(ray[0], 0);
    EXPECT_FLOAT_EQ(ray[1].get<float>(), 0.8f);
    const Vector3d from(ray[2], ray[3], ray[4]), along(ray[5], ray[6], ray[7]);
    EXPECT_NEAR(from.z(), 200.0, 1e-3);
    EXPECT_LT(from.cross(along).norm(), 0.01);  // mm, of float pixels
  }
  const json& description = told["description"];
  EXPECT_EQ(description["width_px"], kStraightWidth);
  EXPECT_EQ(description["metadata"]["sampling_px"], 1);
  EXPECT_NEAR(description["view_deg"].get<double>(), 2.0 * std::atan(8.0 / 20.0) * 180.0 / M_PI, 1e-9);
  size_t bytes = 0;
  for (const json& plane : description["planes"]) bytes += plane["bytes"].get<size_t>();
  EXPECT_EQ(answer.size() - end - 1, bytes);
}

TEST_F(MadeRays, AreTheSameWhicheverDepthComesFirst) {
  EXPECT_EQ(rays_to_play(geometry_, {depths()[1], depths()[0]}, {}, true).value(),
            rays_to_play(geometry_, depths(), {}, true).value());
}

TEST_F(MadeRays, OfALargePictureAreOfSomeOfItsPixels) {
  near_ = straight_matte("first", 200.0, 3);
  far_ = straight_matte("second", 250.0, 3);
  const std::string answer = rays_to_play(geometry_, depths(), {}, false).value();
  const json told = json::parse(answer.substr(0, answer.find('\n')));
  EXPECT_EQ(told["description"]["metadata"]["sampling_px"], 3);
  EXPECT_EQ(told["description"]["width_px"], 6);
  const absl::Status file = file_of_rays(geometry_, depths(), {}).status();
  EXPECT_EQ(file.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(file.message().find("use glasswing rays first second"), std::string::npos) << file;
}

TEST_F(MadeRays, HaveLimitsByTheMachinesMemory) {
  EXPECT_EQ(ray_limits(std::int64_t{64} << 30).pixels, RayLimits().pixels);
  const RayLimits of_small = ray_limits(std::int64_t{8} << 30);
  EXPECT_LE(of_small.pixels * 3840 + of_small.modes * 300, std::int64_t{1} << 30);
  EXPECT_GT(of_small.pixels, 100'000);
  const RayLimits few{.pixels = 1000, .modes = 1000};
  const absl::Status refused = rays_to_play(geometry_, depths(), few, false).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(
      refused.message(),
      "the object has 1152 modes in both mattes; the console matches up to 1000, and glasswing rays first "
      "second any number");
}

TEST_F(MadeRays, HaveTheFileOfGlasswingRays) {
  const RayMatte rays = decode_rays(file_of_rays(geometry_, depths(), {}).value()).value();
  EXPECT_EQ(rays.metadata.counts().matched(), 3 * kStraightWidth * kStraightHeight);
  EXPECT_EQ(rays.metadata.geometry().warnings(0), "made by hand");
}

TEST_F(MadeRays, NameWhatIsWrong) {
  auto wrong = depths();
  wrong[1].pose = "farther";
  const absl::Status pose = rays_to_play(geometry_, wrong, {}, false).status();
  EXPECT_EQ(pose.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(pose.message(), "the geometry has no pose \"farther\" of monitor \"back\"; it has: near, far");
  wrong = depths();
  wrong[1].file = "no matte";
  const absl::Status file = rays_to_play(geometry_, wrong, {}, false).status();
  EXPECT_EQ(file.code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(file.message().substr(0, 21), "the matte of second: ") << file;
  std::string bytes = kStraightGeometry;
  bytes.replace(bytes.find("\"far\""), 5, "\"f\\377\"");
  EXPECT_EQ(geometry_in(bytes).status().message(),
            "the geometry: the name of a pose or of its monitor, \"f\\xff\", is not UTF-8");
  EXPECT_EQ(geometry_in("camera {\n  width: 3 }").status().message().substr(0, 22), "the geometry: line 2: ");
}

}  // namespace
}  // namespace glasswing
