// Three objects side by side on the simulated stage, whose footprints few Gaussians describe: a pane of
// frosted glass, a blown glass bubble, and a coin with a face brushed in circles. All are gray.
//
//   pane     polished in front, ground behind: rays are refracted, then scattered by microfacets: a sharp
//   core with long tails bubble   a hollow sphere: at each wall a ray divides by Fresnel's reflectance; the
//   rim bends light into arcs coin     metal, Schlick's reflectance: microfacets are rough across its
//   circular grooves, which turn around the centre
#pragma once

#include <memory>

#include "core/sim/scene.h"

namespace glasswing {

std::unique_ptr<Scene> make_still_life(MonitorSize back);

// A hollow sphere of glass. Paths of less than 0.001 of a ray's light are left out.
struct HollowSphere {
  Vec3 centre;
  double radius, inner_radius;
  double index;
  // None if the ray misses it.
  std::optional<std::vector<Path>> trace(const Ray& ray) const;
};

}  // namespace glasswing
