// Rays as pages show them: directions in an environment, and a few of them in space.
#pragma once

#include <cstddef>
#include <vector>

#include "core/matte/matte.h"
#include "core/rays/ray_matte.h"

namespace glasswing {

// The directions as a matte before the faces of a cube, for encode_web_matte(). Of `step` x `step` pixels one
// is in it. `lossless`: as matte_of_directions().
Matte web_matte_of(const RayMatte& rays, int step, bool lossless);

// The angle that the camera sees across, without distortion.
double view_deg(const v1::CameraGeometry& camera);

// Green's rays in the object that carry 2 % of the light or more: those of evenly distant pixels, at most
// `max_count` of them.
std::vector<Ray> sampled_rays(const RayMatte& rays, size_t max_count);

}  // namespace glasswing
