#include "core/sim/microfacets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace glasswing {
namespace {

constexpr Microfacets kKinds[] = {{.rough_x = 0.1, .rough_y = 0.1}, {.rough_x = 0.3, .rough_y = 0.05}};

Vec3 leaning(double cosine, double turn_rad) {
  const double sine = std::sqrt(1.0 - cosine * cosine);
  return {sine * std::cos(turn_rad), sine * std::sin(turn_rad), cosine};
}

// Over all facets, by the midpoint rule in slopes x = a_x t cos, y = a_y t sin with t = r / (1 - r); f is
// times their area, D d omega = D m_z^3 dx dy. The rule's error falls with the square of its steps.
double over_facets(const Microfacets& rough, const std::function<double(Vec3)>& f) {
  constexpr int kRadii = 600, kTurns = 200;
  double sum = 0.0;
  for (int i = 0; i < kRadii; ++i) {
    const double r = (i + 0.5) / kRadii, t = r / (1.0 - r), step = 1.0 / ((1.0 - r) * (1.0 - r) * kRadii);
    for (int j = 0; j < kTurns; ++j) {
      const double turn_rad = 2.0 * std::numbers::pi * (j + 0.5) / kTurns;
      const Vec3 m =
          normalized({rough.rough_x * t * std::cos(turn_rad), rough.rough_y * t * std::sin(turn_rad), 1.0});
      sum += f(m) * rough.density(m) * std::pow(m.z, 3) * rough.rough_x * rough.rough_y * t * step * 2.0 *
             std::numbers::pi / kTurns;
    }
  }
  return sum;
}
constexpr double kQuadrature =
    1e-4;  // halving the steps changes the integrals below by less than a quarter of it

TEST(Microfacets, CoverTheSurfaceOnce) {
  for (const Microfacets& rough : kKinds)
    EXPECT_NEAR(over_facets(rough, [](Vec3 m) { return m.z; }), 1.0, kQuadrature);
}

// Smith's masking is what makes the visible facets' projected area that of the surface.
TEST(Microfacets, ShowTheSurfacesAreaFromEverywhere) {
  for (const Microfacets& rough : kKinds) {
    for (const double cosine : {1.0, 0.5, 0.15}) {
      const Vec3 from = leaning(cosine, 0.7);
      const double seen = over_facets(rough, [&](Vec3 m) { return std::max(dot(m, from), 0.0); });
      EXPECT_NEAR(rough.visible(from) * seen, cosine, kQuadrature);
    }
  }
}

// Means over the points of all rays are the integrals over the visible facets.
TEST(Microfacets, SamplesAreTheVisibleFacets) {
  for (const Microfacets& rough : kKinds) {
    for (const double cosine : {1.0, 0.5, 0.15}) {
      const Vec3 from = leaning(cosine, 0.7);
      const auto truth = [&](const std::function<double(Vec3)>& f) {
        return over_facets(
            rough, [&](Vec3 m) { return f(m) * rough.visible(from) * std::max(dot(m, from), 0.0) / cosine; });
      };
      const auto sampled = [&](const std::function<double(Vec3)>& f) {
        constexpr int kCount = 1000;
        double sum = 0.0;
        for (int ray = 0; ray < kScatterRays; ++ray) {
          for (const ScatterPoint& point : scatter_points(ray, kCount))
            sum += f(rough.sample(from, point.u, point.v)) * point.weight / kScatterRays;
        }
        return sum;
      };
      // 16000 evenly spread points: errors fall nearly with their number; a lobe of the wrong width, a
      // mirrored or unturned one differs by 0.05 or more.
      const auto near = [&](const std::function<double(Vec3)>& f) {
        EXPECT_NEAR(sampled(f), truth(f), 1e-3);
      };
      near([](Vec3 m) { return m.z; });
      near([&](Vec3 m) { return std::tanh(m.x / rough.rough_x); });
      near([&](Vec3 m) { return std::tanh(m.y / rough.rough_y); });
      near([&](Vec3 m) { return std::exp(-m.x * m.x / (rough.rough_x * rough.rough_x)); });
      near([&](Vec3 m) { return std::exp(-m.y * m.y / (rough.rough_y * rough.rough_y)); });
    }
  }
}

// No light is gained, whatever the direction.
TEST(Microfacets, ThrowBackNoMoreThanThereIs) {
  for (const Microfacets& rough : kKinds) {
    for (int ray = 0; ray < kScatterRays; ++ray) {
      for (const double cosine : {1.0, 0.5, 0.1}) {
        const Vec3 from = leaning(cosine, 0.2);
        double light = 0.0, weights = 0.0;
        for (const ScatterPoint& point : scatter_points(ray, 48)) {
          const Vec3 facet = rough.sample(from, point.u, point.v);
          EXPECT_NEAR(dot(facet, facet), 1.0, 1e-12);
          EXPECT_GE(dot(facet, from), -1e-12);
          const Vec3 to = reflected(-1.0 * from, facet);
          if (to.z > 0.0) light += point.weight * rough.visible(to);
          weights += point.weight;
        }
        EXPECT_NEAR(weights, 1.0, 1e-12);
        EXPECT_LE(light, 1.0);
        EXPECT_GT(light, 0.5);
      }
    }
  }
}

}  // namespace
}  // namespace glasswing
