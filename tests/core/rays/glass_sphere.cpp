// A sphere of clear glass in closed form, by Snell and Fresnel: its rays, and how it looks in an environment
// by brute force.
//
//   glass-sphere WIDTH HEIGHT FROST_DEG RAYS.exr [ENVIRONMENT TRUTH.exr]
//
// Frost scatters what passes the sphere, with this standard deviation; in TRUTH.exr there is none.
// The camera sees 50 degrees across. Light passes the sphere, or is reflected by its front; what is reflected
// within it is left out of both. A pixel is the mean of kSide x kSide points, a bundle the mean and the
// spread of their directions.
#include <Eigen/Eigenvalues>
#include <cstdlib>
#include <iostream>

#include "core/base/status.h"
#include "core/file/file.h"
#include "core/image/image_file.h"
#include "core/rays/ray_file.h"
#include "tests/core/rays/snell.h"

namespace glasswing {
namespace {

using Eigen::Vector3d;

constexpr double kRefraction = 1.5, kRadius_mm = 37.0;
const Vector3d kCentre_mm(10.0, -4.0, 200.0);
constexpr int kPaths = 3;  // beside the sphere, through it, from its front

struct Path {
  double weight = 0.0;
  snell::Line line;
};

// Of a surface, unpolarised: what is reflected.
double reflected(double cosine, double ratio) {
  const double within = std::sqrt(1.0 - ratio * ratio * (1.0 - cosine * cosine));
  const double across = (ratio * cosine - within) / (ratio * cosine + within);
  const double along = (cosine - ratio * within) / (cosine + ratio * within);
  return 0.5 * (across * across + along * along);
}

std::array<Path, kPaths> paths_of(const Vector3d& direction) {
  std::array<Path, kPaths> paths;
  const snell::Line in{Vector3d::Zero(), direction};
  const auto through = snell::through_sphere(in, kCentre_mm, kRadius_mm, kRefraction);
  if (!through) {
    paths[0] = {1.0, in};
    return paths;
  }
  const double to = kCentre_mm.dot(direction), apart = kCentre_mm.squaredNorm() - to * to;
  const Vector3d enter = (to - std::sqrt(kRadius_mm * kRadius_mm - apart)) * direction;
  const Vector3d normal = (enter - kCentre_mm) / kRadius_mm;
  // A sphere's ray leaves at the angle at which it entered, so both surfaces reflect alike.
  const double share = reflected(-direction.dot(normal), 1.0 / kRefraction);
  paths[1] = {(1.0 - share) * (1.0 - share), *through};
  paths[2] = {share, {enter, direction - 2.0 * direction.dot(normal) * normal}};
  return paths;
}

class Scene {
 public:
  Scene(int width_px, int height_px, double frost_rad)
      : width_px_(width_px),
        height_px_(height_px),
        frost_rad_(frost_rad),
        focal_px_(0.5 * width_px / std::tan(25.0 * M_PI / 180.0)) {}

  // `take` of the paths of each point of a pixel.
  template <typename Take>
  void for_points(int x, int y, const Take& take) const {
    constexpr int kSide = 12;
    for (int s = 0; s < kSide * kSide; ++s) {
      const double u = x + (s % kSide + 0.5) / kSide, v = y + (s / kSide + 0.5) / kSide;
      take(paths_of(Vector3d(u - 0.5 * width_px_, v - 0.5 * height_px_, focal_px_).normalized()),
           1.0 / (kSide * kSide));
    }
  }

  RayMatte rays() const {
    RayMatte rays(width_px_, height_px_, kPaths);
    describe(rays.metadata);
    for (int y = 0; y < height_px_; ++y) {
      for (int x = 0; x < width_px_; ++x) {
        const std::array<Ray, kPaths> bundles = bundles_of(x, y);
        rays.coverage(x, y) = 1.0f - bundles[0].weight;
        for (int c = 0; c < kChannels; ++c) std::ranges::copy(bundles, rays.rays(x, y, c).begin());
      }
    }
    return rays;
  }

  RadianceImage in(const RadianceImage& map) const {
    RadianceImage seen(width_px_, height_px_);
    for (int y = 0; y < height_px_; ++y) {
      for (int x = 0; x < width_px_; ++x) {
        for_points(x, y, [&](const std::array<Path, kPaths>& paths, double share) {
          for (const Path& path : paths) {
            if (path.weight == 0.0) continue;
            const Vector3d d = path.line.direction.normalized();
            const double lon = std::atan2(d.x(), d.z()), down = std::acos(std::clamp(-d.y(), -1.0, 1.0));
            const int u =
                std::min(static_cast<int>((lon / (2.0 * M_PI) + 0.5) * map.width_px), map.width_px - 1);
            const int v = std::min(static_cast<int>(down / M_PI * map.height_px), map.height_px - 1);
            for (int c = 0; c < kChannels; ++c)
              seen.at(x, y, c) += static_cast<float>(share * path.weight) * map.at(u, v, c);
          }
        });
      }
    }
    return seen;
  }

 private:
  std::array<Ray, kPaths> bundles_of(int x, int y) const {
    struct Sum {
      double weight = 0.0;
      Vector3d origin = Vector3d::Zero(), direction = Vector3d::Zero();
      Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    };
    std::array<Sum, kPaths> sums;
    for_points(x, y, [&](const std::array<Path, kPaths>& paths, double share) {
      for (size_t p = 0; p < kPaths; ++p) {
        const double weight = share * paths[p].weight;
        const snell::Line& line = paths[p].line;
        sums[p].weight += weight;
        sums[p].origin += weight * line.origin;
        sums[p].direction += weight * line.direction;
        sums[p].squares += weight * line.direction * line.direction.transpose();
      }
    });
    std::array<Ray, kPaths> bundles;
    for (size_t p = 0; p < kPaths; ++p) {
      const Sum& sum = sums[p];
      if (sum.weight == 0.0) continue;
      const Vector3d mean = sum.direction / sum.weight;
      const double frost = p == 1 ? frost_rad_ : 0.0;
      const Vector3d direction = mean.normalized();
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - direction * direction.transpose();
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(
          sum.squares / sum.weight - mean * mean.transpose() + frost * frost * across);
      Ray& ray = bundles[p];
      ray.weight = static_cast<float>(sum.weight);
      ray.origin_mm = (sum.origin / sum.weight).cast<float>();
      ray.direction = direction.cast<float>();
      for (int axis = 0; axis < 2; ++axis) {
        ray.direction_spread[axis] =
            (std::sqrt(std::max(axes.eigenvalues()[2 - axis], 0.0)) * axes.eigenvectors().col(2 - axis))
                .cast<float>();
      }
      ray.state = p == 0 ? RayState::kStraight : RayState::kMatched;
    }
    return bundles;
  }

  void describe(v1::RayMetadata& metadata) const {
    metadata.set_format_version(1);
    metadata.add_poses("near");
    v1::CameraGeometry& camera = *metadata.mutable_geometry()->mutable_camera();
    camera.set_width_px(width_px_);
    camera.set_height_px(height_px_);
    camera.set_fx_px(focal_px_);
    camera.set_fy_px(focal_px_);
    camera.set_cx_px(0.5 * width_px_);
    camera.set_cy_px(0.5 * height_px_);
    v1::MonitorPose& pose = *metadata.mutable_geometry()->add_monitors();
    pose.set_name("near");
    pose.set_width_px(128);
    pose.set_height_px(96);
    pose.set_pitch_mm(1.0);
    for (const double r : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) pose.add_rotation(r);
    for (const double t : {-64.0, -48.0, 300.0}) pose.add_translation_mm(t);
    v1::MatteMetadata& matte = *metadata.mutable_matte();
    matte.set_format_version(1);
    matte.set_session("sphere");
    matte.set_width_px(width_px_);
    matte.set_height_px(height_px_);
    v1::Monitor& monitor = *matte.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(128);
    monitor.set_height_px(96);
  }

  int width_px_, height_px_;
  double frost_rad_, focal_px_;
};

absl::Status write(int count, char** words) {
  const Scene scene(std::atoi(words[1]), std::atoi(words[2]), std::atof(words[3]) * M_PI / 180.0);
  GW_ASSIGN_OR_RETURN(const std::string bytes, encode_rays(scene.rays()));
  GW_RETURN_IF_ERROR(write_file_durably(words[4], bytes));
  if (count < 7) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const RadianceImage map, read_radiance(words[5], Encoding::kDisplay));
  return write_radiance(words[6], scene.in(map), Encoding::kDisplay);
}

}  // namespace
}  // namespace glasswing

int main(int count, char** words) {
  if (count != 5 && count != 7) {
    std::cerr << "usage: glass-sphere WIDTH HEIGHT FROST_DEG RAYS.exr [ENVIRONMENT TRUTH.exr]\n";
    return 2;
  }
  const absl::Status written = glasswing::write(count, words);
  if (!written.ok()) std::cerr << written << "\n";
  return written.ok() ? 0 : 1;
}
