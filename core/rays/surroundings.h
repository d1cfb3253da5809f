// Composites of rays: over pictures on planes at any depth, and in an environment.
//
// Each ray's bundle is projected to what stands behind: to a plane as a Gaussian of its pixels, to the
// environment as a Gaussian on one of the six faces of a cube around the camera. These are modes of a matte
// whose monitors are planes and faces, so that both compositors (core/matte) look them up. Faces reach beyond
// their neighbours, so no footprint is clipped at an edge, and the map's seam and poles are nowhere special.
// Bundles wider than 2 degrees are summed over a map of 256 x 128 instead.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <vector>

#include "core/image/image.h"
#include "core/rays/cube.h"
#include "core/rays/ray_matte.h"

namespace glasswing {

// Of pictures in linear radiance, 1.0 the light of a monitor's white.
struct PlanePicture {
  MonitorPlane plane;
  RadianceImage picture;  // of exactly the plane's pixels
};
// The pose of the first monitor nearest the object, whose planes pictures lie on. DATA_LOSS: the rays name
// none.
absl::StatusOr<const v1::MonitorPose*> nearest_pose(const RayMatte& rays);
// Parallel to the pose's monitor, at a depth along its normal, and as large; the picture is scaled to it.
PlanePicture picture_at(const v1::MonitorPose& pose, double depth_mm, const RadianceImage& picture);

// Equirectangular: column u of W is lon = 2 pi (u / W - 1/2), row v of H is th = pi v / H, of direction
// (sin th sin lon, -cos th, sin th cos lon) in the camera's frame. So its centre is ahead, its right half to
// the right, its first row above. Pixels are flat.
struct Environment {
  RadianceImage picture;
  double turn_rad = 0.0;  // of the environment about the vertical: what lay ahead moves to the right
};

struct Surroundings {
  std::vector<PlanePicture> planes;  // nearer ones hide what is behind them
  std::optional<Environment> environment;
  // The object absorbs nothing: light without a ray comes equally from the whole environment.
  bool lossless = false;
};

// Rows are shared among `thread_count` threads (0: all cores). `exact`: composite()'s integrals. Takes the
// memory of the rays, the pictures and a few rows. Errors as those of composite().
absl::StatusOr<RadianceImage> composite_rays(const RayMatte& rays, const Surroundings& surroundings,
                                             bool exact = false, int thread_count = 0,
                                             const std::function<void(double)>& progress = nullptr);

// The environment's light, one channel after the other, of a bundle of directions. Exposed for tests.
class EnvironmentMap {
 public:
  explicit EnvironmentMap(const Environment& environment);

  static constexpr double kHalfSide = 1.25;     // of a face at distance 1
  static constexpr double kMaxFaceSd = 0.0349;  // rad, of a bundle that is looked up on a face
  int face_side_px() const { return side_px_; }
  const std::vector<RadianceImage>& faces() const { return faces_; }

  // A bundle's footprint on one of the faces, px; false if it is too wide.
  bool on_face(const Ray& ray, int& face, PlaneFootprint& footprint) const;
  // The mean light of a wide bundle.
  std::array<float, kChannels> wide(const Ray& ray) const;
  std::array<float, kChannels> mean() const { return mean_; }

 private:
  Eigen::Vector3d in_map(const Eigen::Vector3f& direction) const;

  double cos_turn_, sin_turn_;
  int side_px_;
  std::vector<RadianceImage> faces_;
  RadianceImage small_;
  std::array<float, kChannels> mean_{};
};

}  // namespace glasswing
