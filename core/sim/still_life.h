// Three objects side by side on the simulated stage, whose footprints few Gaussians describe: a pane of
// frosted glass, a blown glass bubble, and a coin with a face brushed in circles. All are gray.
//
// - The pane is polished in front and ground behind: rays are refracted, then scattered by microfacets, into
//   a sharp core with long tails.
// - The bubble is a hollow sphere: at each wall a ray divides by Fresnel's reflectance, and the rim bends
//   light into arcs.
// - The coin is metal, with Schlick's reflectance: microfacets are rough across its circular grooves, which
//   turn around the centre.
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
