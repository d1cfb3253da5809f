#include "core/sim/still_life.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/sim/microfacets.h"

namespace glasswing {
namespace {

constexpr double kGlass = 1.5;
constexpr int kFacetsARay = 48;  // of frosted glass and of the coin

// Where a line meets a sphere, as distances along it: nearer, farther.
std::optional<std::pair<double, double>> meet(const Ray& ray, Vec3 centre, double radius) {
  const Vec3 from = ray.origin - centre;
  const double b = dot(from, ray.direction);
  const Vec3 nearest = from - b * ray.direction;
  const double root = radius * radius - dot(nearest, nearest);
  if (root <= 0.0) return std::nullopt;
  return std::pair(-b - std::sqrt(root), -b + std::sqrt(root));
}

// A flat face: `right`, `down` and `normal`, which faces the camera, are unit.
struct Face {
  Vec3 centre, right, down, normal;
  Vec3 own(Vec3 p) const { return {dot(p, right), dot(p, down), dot(p, normal)}; }
  Vec3 back(Vec3 p) const { return p.x * right + p.y * down + p.z * normal; }
  // Where a ray meets it from the front, in its own frame.
  std::optional<Vec3> hit(const Ray& ray) const {
    const double speed = dot(ray.direction, normal);
    if (speed >= 0.0) return std::nullopt;
    const double away = dot(centre - ray.origin, normal) / speed;
    if (away <= 0.0) return std::nullopt;
    return own(at(ray, away) - centre);
  }
};

// Points of scattering for each number of a ray.
class Scatter {
 public:
  Scatter() {
    for (int ray = 0; ray < kScatterRays; ++ray) points_.push_back(scatter_points(ray, kFacetsARay));
  }
  const std::vector<ScatterPoint>& operator()(int sample) const { return points_[sample % kScatterRays]; }

 private:
  std::vector<std::vector<ScatterPoint>> points_;
};

class Pane {
 public:
  explicit Pane(MonitorSize back) : half_width_(0.155 * back.width_px), half_height_(0.30 * back.height_px) {
    constexpr double kAside_rad = 0.3;
    face_ = {.centre = {0.22 * back.width_px, 0.40 * back.height_px, -0.20 * back.width_px},
             .right = {std::cos(kAside_rad), 0.0, std::sin(kAside_rad)},
             .down = {0.0, 1.0, 0.0},
             .normal = {std::sin(kAside_rad), 0.0, -std::cos(kAside_rad)}};
    thickness_ = 0.01 * back.width_px;
  }
  std::optional<std::vector<Path>> trace(const Ray& ray, const std::vector<ScatterPoint>& points) const {
    const std::optional<Vec3> place = face_.hit(ray);
    if (!place || std::abs(place->x) > half_width_ || std::abs(place->y) > half_height_) return std::nullopt;
    const Vec3 down = face_.own(ray.direction), polished{0.0, 0.0, 1.0};
    const double mirrored = reflectance(-down.z, kGlass);
    std::vector<Path> paths{path(*place, reflected(down, polished), mirrored)};
    const Vec3 inside = *refracted(down, polished, kGlass);
    const Vec3 exit = *place + (-thickness_ / inside.z) * inside;
    for (const ScatterPoint& point : points) {
      const Vec3 facet = kGround.sample(-1.0 * inside, point.u, point.v);
      const std::optional<Vec3> out = refracted(inside, facet, 1.0 / kGlass);
      if (!out || out->z >= 0.0) continue;
      const double kept = reflectance(-dot(inside, facet), 1.0 / kGlass);
      paths.push_back(
          path(exit, *out, (1.0 - mirrored) * point.weight * (1.0 - kept) * kGround.visible(*out)));
    }
    return paths;
  }

 private:
  static constexpr Microfacets kGround{.rough_x = 0.14, .rough_y = 0.14};
  Path path(Vec3 from, Vec3 towards, double weight) const {
    return {.ray = {face_.centre + face_.back(from), face_.back(towards)}, .weight = weight};
  }
  Face face_;
  double half_width_, half_height_, thickness_;
};

class Coin {
 public:
  explicit Coin(MonitorSize back) : radius_(0.16 * back.width_px) {
    constexpr double kLying_rad = 0.42;  // between its face and the camera's axis
    const Vec3 normal{0.0, -std::cos(kLying_rad), -std::sin(kLying_rad)}, right{1.0, 0.0, 0.0};
    // Above the id patch, which covers the last rows.
    face_ = {.centre = {0.53 * back.width_px, 0.78 * back.height_px, -0.22 * back.width_px},
             .right = right,
             .down = cross(normal, right),
             .normal = normal};
  }
  std::optional<std::vector<Path>> trace(const Ray& ray, const std::vector<ScatterPoint>& points) const {
    const std::optional<Vec3> place = face_.hit(ray);
    if (!place) return std::nullopt;
    const double away = std::hypot(place->x, place->y);
    if (away > radius_) return std::nullopt;
    const Vec3 out = away > 0.0 ? (1.0 / away) * *place : Vec3{1.0, 0.0, 0.0};
    // x leads away from the centre, across the grooves.
    const Face grooved{.centre = face_.centre + face_.back(*place),
                       .right = face_.back(out),
                       .down = face_.back({-out.y, out.x, 0.0}),
                       .normal = face_.normal};
    const Vec3 from = grooved.own(-1.0 * ray.direction);
    std::vector<Path> paths;
    for (const ScatterPoint& point : points) {
      const Vec3 facet = kBrushed.sample(from, point.u, point.v);
      const Vec3 towards = reflected(-1.0 * from, facet);
      if (towards.z <= 0.0) continue;
      const double metal = kFacing + (1.0 - kFacing) * std::pow(1.0 - dot(from, facet), 5);
      paths.push_back({.ray = {grooved.centre, grooved.back(towards)},
                       .weight = point.weight * metal * kBrushed.visible(towards)});
    }
    return paths;
  }

 private:
  static constexpr double kFacing = 0.9;  // reflectance of metal seen along its normal
  static constexpr Microfacets kBrushed{.rough_x = 0.07, .rough_y = 0.012};
  Face face_;
  double radius_;
};

class StillLife final : public Scene {
 public:
  explicit StillLife(MonitorSize back)
      : pane_(back),
        bubble_{.centre = {0.68 * back.width_px, 0.36 * back.height_px, -0.30 * back.width_px},
                .radius = 0.19 * back.width_px,
                .inner_radius = 0.95 * 0.19 * back.width_px,
                .index = kGlass},
        coin_(back) {}
  std::optional<std::vector<Path>> trace(const Ray& ray, int, int sample) const override {
    if (auto paths = bubble_.trace(ray)) return paths;
    if (auto paths = pane_.trace(ray, scatter_(sample))) return paths;
    return coin_.trace(ray, scatter_(sample));
  }
  bool is_colourless() const override { return true; }

 private:
  Pane pane_;
  HollowSphere bubble_;
  Coin coin_;
  Scatter scatter_;
};

// Light on its way inside the sphere, in the glass or in the hollow.
struct Inside {
  Ray ray;
  double weight;
  bool hollow;
};

// The wall that it meets next.
struct Wall {
  Vec3 point, facing;  // its normal, towards the light
  bool inner;          // the hollow's, else the outer one
};
Wall next_wall(const HollowSphere& sphere, const Inside& part) {
  constexpr double kClear = 1e-9;  // of a radius: light that leaves a wall does not meet it at once
  const auto hollow = meet(part.ray, sphere.centre, sphere.inner_radius);
  const auto wall = [&](double distance, bool inner, double side) {
    const Vec3 point = at(part.ray, distance);
    return Wall{.point = point, .facing = side * normalized(point - sphere.centre), .inner = inner};
  };
  if (part.hollow) return wall(hollow ? hollow->second : 0.0, true, -1.0);
  if (hollow && hollow->first > kClear * sphere.radius) return wall(hollow->first, true, 1.0);
  const auto outer = meet(part.ray, sphere.centre, sphere.radius);
  return wall(outer ? outer->second : 0.0, false, -1.0);
}

}  // namespace

std::optional<std::vector<Path>> HollowSphere::trace(const Ray& ray) const {
  constexpr double kFaintest = 1e-3;
  constexpr int kMaxWalls = 64;
  const auto outside = meet(ray, centre, radius);
  if (!outside || outside->first <= 0.0) return std::nullopt;
  const Vec3 entry = at(ray, outside->first), normal = normalized(entry - centre);
  const double mirrored = reflectance(-dot(ray.direction, normal), index);
  std::vector<Path> paths{{.ray = {entry, reflected(ray.direction, normal)}, .weight = mirrored}};
  std::vector<Inside> parts{
      {.ray = {entry, *refracted(ray.direction, normal, index)}, .weight = 1.0 - mirrored, .hollow = false}};
  for (int walls = 0; walls < kMaxWalls && !parts.empty(); ++walls) {
    const Inside part = parts.back();
    parts.pop_back();
    const auto [point, facing, inner] = next_wall(*this, part);
    const Vec3 towards = part.ray.direction;
    const double eta = part.hollow ? index : 1.0 / index;
    const double kept = part.weight * reflectance(-dot(towards, facing), eta), passed = part.weight - kept;
    if (const auto beyond = refracted(towards, facing, eta); beyond && passed > kFaintest) {
      if (inner) {
        parts.push_back({.ray = {point, *beyond}, .weight = passed, .hollow = !part.hollow});
      } else {
        paths.push_back({.ray = {point, *beyond}, .weight = passed});
      }
    }
    if (kept > kFaintest)
      parts.push_back({.ray = {point, reflected(towards, facing)}, .weight = kept, .hollow = part.hollow});
  }
  return paths;
}

std::unique_ptr<Scene> make_still_life(MonitorSize back) {
  return std::make_unique<StillLife>(back);
}

}  // namespace glasswing
