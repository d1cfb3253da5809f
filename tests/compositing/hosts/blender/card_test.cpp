// Rays that the add-on sets into Blender's scene as a card, rendered by Cycles, against composites of rays
// that integrate every footprint.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/matte/matte_file.h"
#include "core/rays/ray_file.h"
#include "core/rays/surroundings.h"
#include "tests/compositing/host_mattes.h"
#include "tests/compositing/hosts/blender/blender_cases.h"
#include "tests/core/rays/snell.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using Eigen::Vector3d;
using nlohmann::json;

constexpr int kWidth = 40, kHeight = 30;
constexpr double kFocal = 39.0, kCentreX = 19.0, kCentreY = 15.75, kNear_mm = 300.0;
constexpr float kPixelSd = 0.2887f / static_cast<float>(kFocal);  // rad, of a flat pixel
constexpr double kGoal_db = 40.0;
constexpr int kSamples = 1024;  // a pixel, for which noise is some 45 dB

RayMatte rays_of_camera(int rays_per_channel) {
  RayMatte rays(kWidth, kHeight, rays_per_channel);
  rays.metadata.set_format_version(1);
  rays.metadata.add_poses("near");
  v1::CameraGeometry& camera = *rays.metadata.mutable_geometry()->mutable_camera();
  camera.set_width_px(kWidth);
  camera.set_height_px(kHeight);
  camera.set_fx_px(kFocal);
  camera.set_fy_px(kFocal);
  camera.set_cx_px(kCentreX);
  camera.set_cy_px(kCentreY);
  // A monitor that is turned a little about the vertical.
  const double sine = 0.1, cosine = std::sqrt(1.0 - sine * sine);
  v1::MonitorPose& pose = *rays.metadata.mutable_geometry()->add_monitors();
  pose.set_name("near");
  pose.set_width_px(160);
  pose.set_height_px(120);
  pose.set_pitch_mm(2.5);
  for (const double r : {cosine, 0.0, sine, 0.0, 1.0, 0.0, -sine, 0.0, cosine}) pose.add_rotation(r);
  for (const double t : {-200.0, -150.0, kNear_mm + 20.0}) pose.add_translation_mm(t);
  v1::MatteMetadata& matte = *rays.metadata.mutable_matte();
  matte.set_format_version(1);
  matte.set_session("sphere");
  matte.set_width_px(kWidth);
  matte.set_height_px(kHeight);
  v1::Monitor& monitor = *matte.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(160);
  monitor.set_height_px(120);
  return rays;
}

Ray bundle(double weight, const Vector3d& origin, const Vector3d& direction, double sd_rad, double sd_mm) {
  const Vector3d across = direction.unitOrthogonal(), other = direction.cross(across);
  Ray ray;
  ray.weight = static_cast<float>(weight);
  ray.origin_mm = origin.cast<float>();
  ray.direction = direction.cast<float>();
  ray.direction_spread = {(sd_rad * across).cast<float>(), (0.4 * sd_rad * other).cast<float>()};
  ray.origin_spread_mm = {(sd_mm * across).cast<float>(), (-0.7 * sd_mm * other).cast<float>()};
  return ray;
}

// Waves whose colours differ, coarse enough that flat and Gaussian pixels see about the same.
RadianceImage waves(int width_px, int height_px) {
  RadianceImage image(width_px, height_px);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        image.at(x, y, c) = static_cast<float>(
            0.5 + 0.5 * std::sin((14.0 + 8.0 * c) * x / width_px + (20.0 - 6.0 * c) * y / height_px));
      }
    }
  }
  return image;
}

enum class Glass { kReflects, kDisperses };

// A sphere with its own light, a part of which scatters widely; some of its pixels let light past. Its front
// sends light back, or its index is another one in each channel.
RayMatte sphere_rays(Glass glass) {
  const Vector3d centre(12.0, -6.0, 160.0);
  constexpr double kRadius = 42.0;
  RayMatte rays = rays_of_camera(4);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vector3d direction =
          Vector3d((x + 0.5 - kCentreX) / kFocal, (y + 0.5 - kCentreY) / kFocal, 1.0).normalized();
      const bool inside =
          snell::through_sphere({Vector3d::Zero(), direction}, centre, kRadius, 1.5).has_value();
      const bool past = !inside || (x + y) % 3 == 0;
      rays.coverage(x, y) = !inside ? 0.0f : past ? 0.7f : 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        const std::span<Ray> of = rays.rays(x, y, c);
        if (past) {
          of[3] = bundle(inside ? 0.3 : 1.0, Vector3d::Zero(), direction, 0.0, 0.0);
          of[3].direction_spread = {Eigen::Vector3f::UnitX() * kPixelSd, Eigen::Vector3f::UnitY() * kPixelSd};
          of[3].state = RayState::kStraight;
        }
        if (!inside) continue;
        rays.foreground(x, y)[c] = 0.02f * static_cast<float>(c + 1);
        const snell::Line out = *snell::through_sphere({Vector3d::Zero(), direction}, centre, kRadius,
                                                       glass == Glass::kDisperses ? 1.45 + 0.05 * c : 1.5);
        of[0] = bundle(0.4 - 0.05 * c, snell::at_depth(out, kNear_mm), out.direction, 0.012, 1.5);
        of[1] = bundle(0.1, snell::at_depth({Vector3d::Zero(), direction}, kNear_mm), direction, 0.2, 20.0);
        of[1].state = RayState::kUnknown;
        if (glass != Glass::kReflects) continue;
        const double to = centre.dot(direction), apart = centre.squaredNorm() - to * to;
        const Vector3d enter = (to - std::sqrt(kRadius * kRadius - apart)) * direction;
        const Vector3d normal = (enter - centre) / kRadius;
        of[2] = bundle(0.15, enter, direction - 2.0 * direction.dot(normal) * normal, 0.03, 0.0);
      }
    }
  }
  return rays;
}

class BlenderCard : public BlenderCases {
 protected:
  std::string write_rays(const std::string& name, const RayMatte& rays) const {
    return write_bytes(name, encode_rays(rays).value());
  }
  std::string write_picture(const std::string& name, const RadianceImage& picture) const {
    return BlenderCases::write_picture(name, picture, Encoding::kLinear);
  }

  RadianceImage render_of(const std::string& name) const {
    const absl::StatusOr<std::string> bytes = read_file(path(name));
    RadianceImage picture(kWidth, kHeight);
    EXPECT_EQ(bytes.value_or("").size(), picture.samples.size() * sizeof(float)) << error_of(name);
    if (bytes.ok() && bytes->size() == picture.samples.size() * sizeof(float))
      std::memcpy(picture.samples.data(), bytes->data(), bytes->size());
    return picture;
  }
  // Where the object is.
  static double psnr_db(const RadianceImage& picture, const RadianceImage& expected, const RayMatte& rays) {
    double squares = 0.0;
    int count = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        if (!(rays.coverage(x, y) > 0.0f)) continue;
        for (int c = 0; c < kChannels; ++c, ++count)
          squares += std::pow(picture.at(x, y, c) - expected.at(x, y, c), 2);
      }
    }
    return -10.0 * std::log10(squares / count);
  }
  void expect_goal(const std::string& name, const RadianceImage& expected, const RayMatte& rays) {
    const double db = psnr_db(render_of(name), expected, rays);
    EXPECT_GT(db, kGoal_db) << name;
    RecordProperty(name, std::to_string(db));
  }
};

// Once before the add-on's own camera, once before one that stands elsewhere and looks up.
TEST_F(BlenderCard, SeesTheEnvironmentThatTheRaysSee) {
  const RayMatte rays = sphere_rays(Glass::kReflects);
  const RadianceImage map = waves(512, 256);
  const std::string file = write_rays("rays.exr", rays), environment = write_picture("map.exr", map);
  const json others = {{"environment", environment}, {"samples", kSamples}};
  add_case("ahead", {{"rays", file}}, others);
  add_case("turned",
           {{"rays", file}, {"environment_turn", 0.8}, {"environment_gain", 0.5}, {"unit_mm", 10.0}}, others);
  cases_.back()["camera"] = {{"location", {3.0, -2.0, 1.0}}, {"rotation", {1.9, 0.1, 0.6}}};
  run();
  Surroundings around{.planes = {}, .environment = Environment{map, 0.0}, .lossless = false};
  expect_goal("ahead", composite_rays(rays, around, true).value(), rays);
  around.environment->turn_rad = 0.8;
  for (float& light : around.environment->picture.samples) light *= 0.5f;
  expect_goal("turned", composite_rays(rays, around, true).value(), rays);
}

TEST_F(BlenderCard, SeesPlanesAtTheExactDepth) {
  const RayMatte rays = sphere_rays(Glass::kDisperses);
  const MonitorPlane monitor(rays.metadata.geometry().monitors(0));
  const RadianceImage picture = waves(160, 120);
  const std::string file = write_rays("rays.exr", rays), behind = write_picture("picture.exr", picture);
  const auto over = [&](double depth_mm) {
    const Surroundings around{
        .planes = {{monitor.at_depth(depth_mm), picture}}, .environment = std::nullopt, .lossless = false};
    return composite_rays(rays, around, true).value();
  };
  for (const double depth : {monitor.depth_mm(), 520.0}) {
    add_case(fmt::format("{:.0f}", depth), {{"rays", file}, {"exact_depth", depth}},
             {{"planes", {{{"depth", depth}, {"picture", behind}}}}, {"samples", kSamples}});
  }
  run();
  expect_goal(fmt::format("{:.0f}", monitor.depth_mm()), over(monitor.depth_mm()), rays);
  expect_goal("520", over(520.0), rays);
}

// Facets stand where the lines of a sphere's rays cross the camera's, so planes are seen in place at any
// depth: against Snell's law at many points of each pixel.
TEST_F(BlenderCard, SeesPlanesInPlaceAtOtherDepths) {
  const Vector3d centre(12.0, -6.0, 160.0);
  constexpr double kRadius = 42.0, kRefraction = 1.5, kPlane_mm = 420.0;
  constexpr int kPoints = 8;
  RayMatte rays = rays_of_camera(1);
  v1::MonitorPose& pose = *rays.metadata.mutable_geometry()->mutable_monitors(0);
  for (int i = 0; i < 9; ++i) pose.set_rotation(i, i % 4 == 0 ? 1.0 : 0.0);
  pose.set_translation_mm(2, kNear_mm);
  const auto light = [](const Vector3d& place, int channel) {
    return 0.5 + 0.4 * std::sin(0.03 * place.x() + 0.02 * (channel + 1) * place.y());
  };
  RadianceImage picture(800, 600), expected(kWidth, kHeight);
  pose.set_width_px(800);
  pose.set_height_px(600);
  pose.set_pitch_mm(0.5);
  for (int y = 0; y < picture.height_px; ++y) {
    for (int x = 0; x < picture.width_px; ++x) {
      for (int c = 0; c < kChannels; ++c)
        picture.at(x, y, c) =
            static_cast<float>(light({-200.0 + 0.5 * (x + 0.5), -150.0 + 0.5 * (y + 0.5), kPlane_mm}, c));
    }
  }
  const auto through = [&](double x, double y) {
    const Vector3d direction((x - kCentreX) / kFocal, (y - kCentreY) / kFocal, 1.0);
    return snell::through_sphere({Vector3d::Zero(), direction.normalized()}, centre, kRadius, kRefraction);
  };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto out = through(x + 0.5, y + 0.5), right = through(x + 1.0, y + 0.5),
                 down = through(x + 0.5, y + 1.0);
      if (!out || !right || !down || !through(x, y) || !through(x + 1, y + 1) || !through(x, y + 1) ||
          !through(x + 1, y))
        continue;
      const Vector3d plane = snell::at_depth(*out, kPlane_mm);
      if (std::abs(plane.x()) > 150.0 || std::abs(plane.y()) > 100.0) continue;
      // Near the rim a pixel sees more than a Gaussian can tell.
      if (std::max((right->direction - out->direction).norm(), (down->direction - out->direction).norm()) >
          0.08)
        continue;
      rays.coverage(x, y) = 1.0f;
      Ray ray = bundle(1.0, snell::at_depth(*out, kNear_mm), out->direction, 0.0, 0.0);
      // A flat pixel has a standard deviation of 1 / sqrt(12).
      ray.direction_spread = {((right->direction - out->direction) / std::sqrt(3.0)).cast<float>(),
                              ((down->direction - out->direction) / std::sqrt(3.0)).cast<float>()};
      for (int c = 0; c < kChannels; ++c) {
        rays.rays(x, y, c)[0] = ray;
        double sum = 0.0;
        for (int s = 0; s < kPoints * kPoints; ++s) {
          const auto point = through(x + (s % kPoints + 0.5) / kPoints, y + (s / kPoints + 0.5) / kPoints);
          sum += light(snell::at_depth(*point, kPlane_mm), c);
        }
        expected.at(x, y, c) = static_cast<float>(sum / (kPoints * kPoints));
      }
    }
  }
  add_case("plane", {{"rays", write_rays("rays.exr", rays)}},
           {{"planes", {{{"depth", kPlane_mm}, {"picture", write_picture("picture.exr", picture)}}}},
            {"samples", kSamples}});
  run();
  expect_goal("plane", expected, rays);
}

// Of an object that lets no light through, whose colours tell the pixel.
TEST_F(BlenderCard, StandsWhereTheLensSawIt) {
  RayMatte rays = rays_of_camera(1);
  v1::CameraGeometry& camera = *rays.metadata.mutable_geometry()->mutable_camera();
  camera.set_fy_px(1.05 * kFocal);
  camera.set_k1(-0.15);
  camera.set_k2(0.02);
  camera.set_p1(0.01);
  camera.set_p2(-0.02);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      rays.coverage(x, y) = 1.0f;
      rays.foreground(x, y) = {static_cast<float>(x), static_cast<float>(y), 1.0f};
    }
  }
  add_case("opaque", {{"rays", write_rays("rays.exr", rays)}}, {{"samples", 64}});
  run();
  const RadianceImage picture = render_of("opaque");
  const CameraLens lens(camera);
  int seen = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Eigen::Vector2d pixel =
          lens.pixel_of({(x + 0.5 - kCentreX) / kFocal, (y + 0.5 - kCentreY) / kFocal});
      if (pixel.x() < 1.0 || pixel.y() < 1.0 || pixel.x() > kWidth - 1 || pixel.y() > kHeight - 1) continue;
      ++seen;
      // Within a pixel the mean of whole numbers is off by less than half of one.
      EXPECT_NEAR(picture.at(x, y, 0), pixel.x() - 0.5, 0.5) << x << ", " << y;
      EXPECT_NEAR(picture.at(x, y, 1), pixel.y() - 0.5, 0.5) << x << ", " << y;
      EXPECT_NEAR(picture.at(x, y, 2), 1.0, 1e-5) << x << ", " << y;
    }
  }
  EXPECT_GT(seen, kWidth * kHeight / 2);
}

TEST_F(BlenderCard, SaysWhatIsWrong) {
  ASSERT_OK(write_file_durably(path("matte.exr"), encode_matte(pane()).value()));
  write_rays("empty.exr", rays_of_camera(1));
  write_picture("picture.exr", picture_of_waves(8, 8));
  for (const char* const name : {"none", "matte", "empty", "picture"})
    add_case(name, {{"rays", path(name + std::string(".exr"))}}, {{"samples", 1}});
  run();
  for (const auto& [name, words] : {std::pair{"none", "No such file"},
                                    {"matte", "matte.exr holds a matte; glasswing rays makes rays from it"},
                                    {"empty", "no pixel is inside the object"},
                                    {"picture", "picture.exr is not a file of glasswing rays"}})
    EXPECT_NE(error_of(name).find(words), std::string::npos) << name << ": " << error_of(name);
}

}  // namespace
}  // namespace glasswing
