#include "core/sim/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "core/base/status.h"
#include "core/sim/board_scene.h"
#include "core/sim/still_life.h"

namespace glasswing {
namespace {

constexpr double kMin = 2e-3;  // paths with less weight are dropped
constexpr int kMaxBounces = 7;
constexpr double kSkin = 1e-6;

struct Hit {
  double distance;
  Vec3 normal;  // outward
};

// A clear convex body: reflects and refracts at its surface, inside and outside.
class ClearBody {
 public:
  virtual ~ClearBody() = default;
  virtual std::optional<Hit> enter(const Ray& ray) const = 0;
  virtual Hit leave(const Ray& ray) const = 0;  // from inside

  std::optional<std::vector<Path>> trace(const Ray& ray, double index) const {
    const std::optional<Hit> hit = enter(ray);
    if (!hit) return std::nullopt;
    std::vector<Path> paths;
    const Vec3 point = at(ray, hit->distance);
    const double mirrored = reflectance(-dot(ray.direction, hit->normal), index);
    if (mirrored > kMin) {
      paths.push_back({.ray = {point, reflected(ray.direction, hit->normal)}, .weight = mirrored});
    }
    const std::optional<Vec3> inward = refracted(ray.direction, hit->normal, index);
    if (!inward) return paths;
    Ray inside{point + kSkin * *inward, *inward};
    double weight = 1.0 - mirrored;
    for (int bounce = 0; bounce < kMaxBounces && weight > kMin; ++bounce) {
      const Hit wall = leave(inside);
      const Vec3 exit = at(inside, wall.distance);
      const Vec3 facing = -1.0 * wall.normal;
      const double kept = reflectance(-dot(inside.direction, facing), 1.0 / index);
      const std::optional<Vec3> outward = refracted(inside.direction, facing, 1.0 / index);
      if (outward && weight * (1.0 - kept) > kMin) {
        paths.push_back({.ray = {exit, *outward}, .weight = weight * (1.0 - kept)});
      }
      weight *= kept;
      const Vec3 back = reflected(inside.direction, facing);
      inside = {exit + kSkin * back, back};
    }
    return paths;
  }
};

class Ball final : public ClearBody {
 public:
  Ball(Vec3 centre, double radius) : centre_(centre), radius_(radius) {}
  std::optional<Hit> enter(const Ray& ray) const override {
    const Vec3 from = ray.origin - centre_;
    const double b = dot(from, ray.direction);
    const double root = b * b - dot(from, from) + radius_ * radius_;
    if (root <= 0.0) return std::nullopt;
    return hit_at(ray, -b - std::sqrt(root));
  }
  Hit leave(const Ray& ray) const override {
    const Vec3 from = ray.origin - centre_;
    const double b = dot(from, ray.direction);
    return hit_at(ray, -b + std::sqrt(std::max(b * b - dot(from, from) + radius_ * radius_, 0.0)));
  }

 private:
  Hit hit_at(const Ray& ray, double distance) const {
    return {.distance = distance, .normal = normalized(at(ray, distance) - centre_)};
  }
  Vec3 centre_;
  double radius_;
};

// Rotated about the z axis.
class Ellipsoid final : public ClearBody {
 public:
  Ellipsoid(Vec3 centre, Vec3 semiaxes, double turn_rad)
      : centre_(centre), semiaxes_(semiaxes), cos_(std::cos(turn_rad)), sin_(std::sin(turn_rad)) {}
  std::optional<Hit> enter(const Ray& ray) const override {
    const Vec3 from = to_ball(ray.origin - centre_), along = to_ball(ray.direction);
    const double a = dot(along, along), b = dot(from, along);
    const double root = b * b - a * (dot(from, from) - 1.0);
    if (root <= 0.0) return std::nullopt;
    return hit_at(from, along, (-b - std::sqrt(root)) / a);
  }
  Hit leave(const Ray& ray) const override {
    const Vec3 from = to_ball(ray.origin - centre_), along = to_ball(ray.direction);
    const double a = dot(along, along), b = dot(from, along);
    return hit_at(from, along, (-b + std::sqrt(std::max(b * b - a * (dot(from, from) - 1.0), 0.0))) / a);
  }

 private:
  // Maps to the space where the body is a unit ball; a ray's parameter, so its distances, stay the same.
  Vec3 to_ball(Vec3 p) const {
    return {(cos_ * p.x + sin_ * p.y) / semiaxes_.x, (cos_ * p.y - sin_ * p.x) / semiaxes_.y,
            p.z / semiaxes_.z};
  }
  Hit hit_at(Vec3 from, Vec3 along, double distance) const {
    const Vec3 q = from + distance * along;
    const Vec3 gradient{q.x / semiaxes_.x, q.y / semiaxes_.y, q.z / semiaxes_.z};
    return {.distance = distance,
            .normal = normalized(
                {cos_ * gradient.x - sin_ * gradient.y, sin_ * gradient.x + cos_ * gradient.y, gradient.z})};
  }
  Vec3 centre_, semiaxes_;
  double cos_, sin_;
};

// The intersection of half-spaces dot(normal, p - centre) <= distance.
class CutStone final : public ClearBody {
 public:
  struct Facet {
    Vec3 normal;
    double distance;
  };
  CutStone(Vec3 centre, std::vector<Facet> facets) : centre_(centre), facets_(std::move(facets)) {}
  std::optional<Hit> enter(const Ray& ray) const override {
    double near = -std::numeric_limits<double>::infinity();
    double far = std::numeric_limits<double>::infinity();
    Vec3 normal;
    for (const Facet& facet : facets_) {
      const double speed = dot(facet.normal, ray.direction);
      const double room = facet.distance - dot(facet.normal, ray.origin - centre_);
      if (std::abs(speed) < 1e-12) {
        if (room < 0.0) return std::nullopt;
        continue;
      }
      const double t = room / speed;
      if (speed < 0.0 && t > near) {
        near = t;
        normal = facet.normal;
      }
      if (speed > 0.0) far = std::min(far, t);
    }
    if (near >= far || near <= 0.0) return std::nullopt;
    return Hit{.distance = near, .normal = normal};
  }
  Hit leave(const Ray& ray) const override {
    Hit hit{.distance = std::numeric_limits<double>::infinity(), .normal = {}};
    for (const Facet& facet : facets_) {
      const double speed = dot(facet.normal, ray.direction);
      if (speed <= 0.0) continue;
      const double t = (facet.distance - dot(facet.normal, ray.origin - centre_)) / speed;
      if (t < hit.distance) hit = {.distance = std::max(t, 0.0), .normal = facet.normal};
    }
    return hit;
  }

 private:
  Vec3 centre_;
  std::vector<Facet> facets_;
};

Vec3 turned(Vec3 p, double about_x_rad, double about_y_rad) {
  const Vec3 q{p.x, p.y * std::cos(about_x_rad) - p.z * std::sin(about_x_rad),
               p.y * std::sin(about_x_rad) + p.z * std::cos(about_x_rad)};
  return {q.x * std::cos(about_y_rad) + q.z * std::sin(about_y_rad), q.y,
          -q.x * std::sin(about_y_rad) + q.z * std::cos(about_y_rad)};
}

// The 20 face and 12 vertex directions of an icosahedron, the latter cut slightly less deep.
std::vector<CutStone::Facet> crystal_facets(double radius) {
  const double golden = std::numbers::phi;
  std::vector<CutStone::Facet> facets;
  const auto add = [&](Vec3 direction, double distance) {
    facets.push_back({.normal = turned(normalized(direction), 0.55, 0.90), .distance = distance});
  };
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-1.0, 1.0}) {
      add({0.0, a, b * golden}, 1.03 * radius);
      add({a, b * golden, 0.0}, 1.03 * radius);
      add({b * golden, 0.0, a}, 1.03 * radius);
      add({0.0, a / golden, b * golden}, radius);
      add({a / golden, b * golden, 0.0}, radius);
      add({b * golden, 0.0, a / golden}, radius);
      for (const double c : {-1.0, 1.0}) add({a, b, c}, radius);
    }
  }
  return facets;
}

// A cut crystal whose index rises from red to blue.
class Crystal final : public Scene {
 public:
  explicit Crystal(MonitorSize back)
      : stone_({0.5 * back.width_px, 0.5 * back.height_px, -0.32 * back.width_px},
               crystal_facets(0.325 * std::min(back.height_px, back.width_px))) {}
  std::optional<std::vector<Path>> trace(const Ray& ray, int channel, int) const override {
    constexpr std::array<double, 3> kIndex{1.500, 1.518, 1.540};
    return stone_.trace(ray, kIndex[channel]);
  }

 private:
  CutStone stone_;
};

// A flat disc that a ray can hit from either side.
struct Disc {
  Vec3 centre, normal;  // towards the camera
  double radius;
  std::optional<Vec3> hit(const Ray& ray) const {
    const double speed = dot(ray.direction, normal), away = dot(centre - ray.origin, normal) / speed;
    if (speed == 0.0 || away <= 0.0) return std::nullopt;
    const Vec3 point = at(ray, away);
    const Vec3 offset = point - centre;
    if (dot(offset, offset) > radius * radius) return std::nullopt;
    return point;
  }
};

Vec3 lying(double angle_rad) {
  return {0.0, -std::cos(angle_rad), -std::sin(angle_rad)};
}

// A ball of glass above a sheet of glass seen at a grazing angle, so that it reflects and transmits about
// equally.
class Glass final : public Scene {
 public:
  explicit Glass(MonitorSize back)
      : ball_({0.34 * back.width_px, 0.40 * back.height_px, -0.60 * back.width_px}, 0.26 * back.height_px),
        sheet_{.centre = {0.62 * back.width_px, 0.70 * back.height_px, -0.45 * back.width_px},
               .normal = lying(0.21),
               .radius = 0.36 * back.width_px} {}
  std::optional<std::vector<Path>> trace(const Ray& ray, int, int) const override {
    constexpr double kIndex = 1.5;
    if (auto paths = ball_.trace(ray, kIndex)) return paths;
    const std::optional<Vec3> point = sheet_.hit(ray);
    if (!point) return std::nullopt;
    // Both faces of the sheet, all orders of reflection between them.
    const double once = reflectance(std::abs(dot(ray.direction, sheet_.normal)), kIndex);
    const double mirrored = 2.0 * once / (1.0 + once);
    return std::vector<Path>{{.ray = {*point, reflected(ray.direction, sheet_.normal)}, .weight = mirrored},
                             {.ray = {*point, ray.direction}, .weight = 1.0 - mirrored}};
  }
  bool is_colourless() const override { return true; }

 private:
  Ball ball_;
  Disc sheet_;
};

// A disc of brushed metal: its facets are rougher across the brushing than along it.
class Brushed final : public Scene {
 public:
  explicit Brushed(MonitorSize back)
      : disc_{.centre = {0.5 * back.width_px, 0.70 * back.height_px, -0.46 * back.width_px},
              .normal = lying(0.25),
              .radius = 0.40 * back.width_px} {
    const Vec3 across{1.0, 0.0, 0.0};
    const Vec3 along = cross(disc_.normal, across);
    constexpr double kTurn_rad = 25.0 * std::numbers::pi / 180.0;
    const Vec3 rough = std::cos(kTurn_rad) * across + std::sin(kTurn_rad) * along;
    const Vec3 smooth = std::cos(kTurn_rad) * along - std::sin(kTurn_rad) * across;
    constexpr double kRough = 0.05, kSmooth = 0.012;  // sd of the facets' slopes
    for (int i = 0; i < kPoints; ++i) {
      // A two-dimensional low-discrepancy sequence, made normal by Box-Muller.
      const double u = std::fmod((i + 0.5) * 0.7548776662466927, 1.0);
      const double turn_rad = 2.0 * std::numbers::pi * std::fmod((i + 0.5) * 0.5698402909980532, 1.0);
      const double length = std::sqrt(-2.0 * std::log(1.0 - u));
      facets_.push_back(normalized(disc_.normal + kRough * length * std::cos(turn_rad) * rough +
                                   kSmooth * length * std::sin(turn_rad) * smooth));
    }
  }
  std::optional<std::vector<Path>> trace(const Ray& ray, int channel, int sample) const override {
    const std::optional<Vec3> point = disc_.hit(ray);
    if (!point) return std::nullopt;
    constexpr std::array<double, 3> kTint{0.80, 0.74, 0.66};
    std::vector<Path> paths;
    for (int i = 0; i < kFacets; ++i) {
      const Vec3& normal = facets_[(sample * kFacets + i) % kPoints];
      if (dot(normal, ray.direction) >= 0.0) continue;
      paths.push_back(
          {.ray = {*point, reflected(ray.direction, normal)}, .weight = kTint[channel] / kFacets});
    }
    return paths;
  }
  Colour foreground(const Ray&) const override { return {0.045f, 0.038f, 0.018f}; }

 private:
  static constexpr int kFacets = 24;            // per ray
  static constexpr int kPoints = 16 * kFacets;  // in all
  Disc disc_;
  std::vector<Vec3> facets_;  // normals, kPoints of them
};

// A flat drop of water that drifts to and fro and wobbles, twice as fast, in its lowest mode: alternately
// long and wide, at constant volume.
class Drop final : public Scene {
 public:
  static constexpr Motion kMotion{.phases = 36, .period = std::chrono::milliseconds(1200)};

  Drop(MonitorSize back, int phase, bool lit) : body_(at_phase(back, phase)) {
    const double width = back.width_px, height = back.height_px;
    if (lit)
      lamp_ = Lamp{
          .centre = {0.1 * width, -0.5 * height, -2.0 * width}, .radius = 0.12 * width, .radiance = 40.0};
  }
  std::optional<std::vector<Path>> trace(const Ray& ray, int, int) const override {
    constexpr double kIndex = 1.333;
    return body_.trace(ray, kIndex);
  }
  std::optional<Lamp> lamp() const override { return lamp_; }
  bool is_colourless() const override { return true; }

 private:
  static Ellipsoid at_phase(MonitorSize back, int phase) {
    const double side = std::min(back.width_px, back.height_px), radius = 0.27 * side;
    const double turn_rad = 2.0 * std::numbers::pi * phase / kMotion.phases;
    const double longer = 1.0 + 0.18 * std::cos(2.0 * turn_rad), wider = 2.0 - longer;
    return {{0.5 * back.width_px + 0.08 * side * std::cos(turn_rad),
             0.5 * back.height_px + 0.05 * side * std::sin(2.0 * turn_rad), -0.35 * side},
            {radius * wider, radius * longer, 0.5 * radius / (wider * longer)},
            0.35 * std::sin(turn_rad)};
  }
  Ellipsoid body_;
  std::optional<Lamp> lamp_;
};

// A scene's object, turned with its table.
class Turned final : public Scene {
 public:
  Turned(std::unique_ptr<Scene> scene, Vec3 centre, const Turntable& table)
      : scene_(std::move(scene)), centre_(centre), rotation_(rotation_of(table)) {}
  std::optional<std::vector<Path>> trace(const Ray& ray, int channel, int sample) const override {
    std::optional<std::vector<Path>> paths = scene_->trace(own(ray), channel, sample);
    if (!paths) return paths;
    for (Path& path : *paths)
      path.ray = {centre_ + rotation_(path.ray.origin - centre_), rotation_(path.ray.direction)};
    return paths;
  }
  Colour foreground(const Ray& ray) const override { return scene_->foreground(own(ray)); }
  std::optional<Lamp> lamp() const override { return scene_->lamp(); }
  bool is_colourless() const override { return scene_->is_colourless(); }

 private:
  // A ray in the object's own frame.
  Ray own(const Ray& ray) const {
    return {centre_ + rotation_.back(ray.origin - centre_), rotation_.back(ray.direction)};
  }
  std::unique_ptr<Scene> scene_;
  Vec3 centre_;
  Rotation rotation_;
};

absl::StatusOr<std::unique_ptr<Scene>> make_still(const std::string& name, MonitorSize back, int phase) {
  if (name == "crystal") return std::make_unique<Crystal>(back);
  if (name == "glass") return std::make_unique<Glass>(back);
  if (name == "brushed") return std::make_unique<Brushed>(back);
  if (name == "still-life") return make_still_life(back);
  if (name == "wobble") return std::make_unique<Drop>(back, phase, false);
  if (name == "wobble-lit") return std::make_unique<Drop>(back, phase, true);
  if (name == "board") return make_board(back);
  if (name == "none") return nullptr;
  return absl::InvalidArgumentError(fmt::format(
      "scene is \"{}\"; there are: crystal, glass, brushed, still-life, wobble, wobble-lit, board, none",
      name));
}

}  // namespace

bool Lamp::lights(const Ray& ray) const {
  const Vec3 from = ray.origin - centre;
  const double towards = -dot(from, ray.direction);
  return towards > 0.0 && dot(from, from) - towards * towards < radius * radius;
}

Motion motion_of(const std::string& scene) {
  return scene == "wobble" || scene == "wobble-lit" ? Drop::kMotion : Motion();
}

Vec3 table_centre(const std::string& scene, MonitorSize back) {
  const double width = back.width_px;
  double depth = 0.32 * width;  // of the crystal
  if (scene == "glass" || scene == "board") depth = 0.5 * width;
  if (scene == "brushed") depth = 0.46 * width;
  if (scene == "still-life") depth = 0.22 * width;
  if (scene.starts_with("wobble")) depth = 0.35 * std::min(back.width_px, back.height_px);
  return {0.5 * width, 0.5 * back.height_px, -depth};
}

absl::StatusOr<std::unique_ptr<Scene>> make_scene(const std::string& name, MonitorSize back, int phase,
                                                  const Turntable& table) {
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Scene> scene, make_still(name, back, phase));
  if (scene == nullptr || table == Turntable()) return scene;
  return std::make_unique<Turned>(std::move(scene), table_centre(name, back), table);
}

}  // namespace glasswing
