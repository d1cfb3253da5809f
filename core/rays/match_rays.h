// Rays from mattes of one object in front of monitors at two depths (docs/rays.md).
//
// In each pixel and channel the modes of one depth share their light with those of the other: pairs are taken
// in the order of their cost, each with as much light as both have left. The cost of a pair is the difference
// of the weights and, from the second pass on, the distance of the pair's two places from those of its
// neighbours' pairs. So a path that one fit represents by one mode and the other by three becomes three rays,
// and both recorded depths are kept as they are.
//
// A pair's footprints S_n and S_f are joined by the turn Q for which S_f^(1/2) Q is nearest A S_n^(1/2),
// where A is how the far place moves with the near one from pixel to pixel; if the neighbours do not
// determine it, A = I.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/matte/matte.h"
#include "core/rays/ray_matte.h"

namespace glasswing {

// `poses` names the geometry's pose of each matte. Light that only one depth saw gets a direction from rays
// beside it, whose standard error widens its spread; RayState says so. Standard errors have those of the
// poses, if the geometry has their covariances. INVALID_ARGUMENT: the mattes differ in size,
// are of boxes, or not of the geometry's camera; their monitors stand in one plane. NOT_FOUND: no such pose.
absl::StatusOr<RayMatte> match_rays(const Matte& one, const Matte& other, const v1::RigGeometry& geometry,
                                    const std::vector<std::string>& poses);

// Of one depth: light is assumed to come from far away, so that its direction is that from the object, which
// is assumed to be at `object_depth_mm` along the camera's axis, to the mode's place.
absl::StatusOr<RayMatte> far_light_rays(const Matte& matte, const v1::RigGeometry& geometry,
                                        const std::string& pose, double object_depth_mm);

}  // namespace glasswing
