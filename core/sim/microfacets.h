// Rough surfaces as mirrors too small to see, whose normals have the GGX distribution (Walter et al. 2007;
// Heitz 2014). In the surface's frame, z its normal, with roughness a_x and a_y:
//
//   D(m)  = 1 / (pi a_x a_y q^2),   q = m_x^2 / a_x^2 + m_y^2 / a_y^2 + m_z^2
//   G1(v) = 2 / (1 + sqrt(1 + (a_x^2 v_x^2 + a_y^2 v_y^2) / v_z^2))
//
// D m_z integrates to 1. Its core is as sharp as a Gaussian's, but its tails fall only with the fourth power
// of the slope. The facets that are visible from v have the density G1(v) max(v.m, 0) D(m) / v_z, of integral
// 1, and pass the share G1(o) of what they send towards o, so that no light is gained.
#pragma once

#include <vector>

#include "core/sim/optics.h"

namespace glasswing {

struct Microfacets {
  double rough_x, rough_y;  // above 0: the slope, along x and y, up to which half of the facets lie

  double density(Vec3 normal) const;
  // `towards` is unit; either side of the surface.
  double visible(Vec3 towards) const;
  // The facet that a pair of uniform numbers stands for, of those visible from `from`, above the surface
  // (Heitz 2018).
  Vec3 sample(Vec3 from, double u, double v) const;
};

// Pairs of numbers for one of kScatterRays rays, with weights that sum to 1: all rays' together are a
// Fibonacci spiral, dense in the tails too, as u = 1 - (1 - s)^2 with evenly spread s and the weight du/ds.
struct ScatterPoint {
  double u, v, weight;
};
inline constexpr int kScatterRays = 16;
std::vector<ScatterPoint> scatter_points(int ray, int count);

}  // namespace glasswing
