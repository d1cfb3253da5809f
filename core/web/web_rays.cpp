#include "core/web/web_rays.h"

#include <cmath>
#include <numbers>

#include "core/rays/cube.h"

namespace glasswing {
namespace {

// Pixels and widths of footprints are coded in units of a face's pixel, which is half a pixel of a camera
// that sees 1280 px across 50 degrees.
constexpr Cube kCube{.half_side = 1.0, .side_px = 3600};

}  // namespace

Matte web_matte_of(const RayMatte& rays, int step, bool lossless) {
  return matte_of_directions(rays, kCube, step, lossless);
}

double view_deg(const v1::CameraGeometry& camera) {
  return 2.0 * std::atan2(0.5 * camera.width_px(), camera.fx_px()) * 180.0 / std::numbers::pi;
}

std::vector<Ray> sampled_rays(const RayMatte& rays, size_t max_count) {
  constexpr float kMinWeight = 0.02f;
  constexpr int kGreen = 1;
  std::vector<Ray> sampled;
  for (int step = 1;; ++step) {
    sampled.clear();
    for (int y = step / 2; y < rays.height_px(); y += step) {
      for (int x = step / 2; x < rays.width_px() && sampled.size() <= max_count; x += step) {
        if (!(rays.coverage(x, y) > 0.0f)) continue;
        for (const Ray& ray : rays.rays(x, y, kGreen)) {
          if (ray.weight >= kMinWeight) sampled.push_back(ray);
        }
      }
    }
    // A single pixel has no more rays than a page shows.
    if (sampled.size() <= max_count || step > std::max(rays.width_px(), rays.height_px())) return sampled;
  }
}

}  // namespace glasswing
