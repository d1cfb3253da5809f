// Rays fall straight on the first monitor, in the plane z = 0, from above; units are its pixels.
#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <random>
#include <tuple>

#include "tests/gate/scene.h"

namespace glasswing::gate {
namespace {

using Vec = Eigen::Vector3d;

struct Ray {
  Vec from = Vec::Zero(), to = Vec::Zero();  // a point, and the unit direction
  double light = 1.0;
};

// A ray behind the surface (`n`: unit normal towards it; `ratio`: index before over index behind); none if
// all light is reflected.
std::optional<Vec> refracted(const Vec& d, const Vec& n, double ratio) {
  const double cosine = -d.dot(n), square = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
  if (square < 0.0) return std::nullopt;
  return (ratio * d + (ratio * cosine - std::sqrt(square)) * n).normalized();
}

// The reflected share of unpolarised light (Fresnel).
double reflectance(const Vec& before, const Vec& behind, const Vec& n, double ratio) {
  const double a = -before.dot(n), b = -behind.dot(n);
  const double s = (ratio * a - b) / (ratio * a + b), p = (ratio * b - a) / (ratio * b + a);
  return 0.5 * (s * s + p * p);
}

// The rays that leave an object where one fell on it, by the channel's index of refraction; none: it misses.
using Object = std::function<std::optional<std::vector<Ray>>(double x, double y, size_t channel)>;

// The second monitor stands at the left, its x down from z = 76.
constexpr double kLeftPlane = -6.0, kLeftTop = 76.0;

void put_object(Scene& scene, int rays, const std::array<double, 3>& foreground, const Object& object) {
  using Pixel = std::tuple<int, size_t, int, int>;  // monitor, channel, y, x
  for (int row = 0; row < scene.camera.height_px; ++row) {
    for (int column = 0; column < scene.camera.width_px; ++column) {
      std::map<Pixel, double> light;
      const double each = 1.0 / (rays * rays);
      double covered = 0.0;
      const auto add = [&](int monitor, size_t channel, double x, double y, double part) {
        const Size size = scene.monitors[monitor];
        if (x < 0.0 || y < 0.0 || x >= size.width_px || y >= size.height_px) return;
        light[{monitor, channel, static_cast<int>(y), static_cast<int>(x)}] += part * each;
      };
      const auto trace = [&](double x, double y, size_t channel) {
        const auto leaving = object(x, y, channel);
        if (!leaving) return add(0, channel, x, y, 1.0);
        covered += each / 3.0;
        for (const Ray& ray : *leaving) {
          const double left = (kLeftPlane - ray.from.x()) / ray.to.x();
          const Vec on_left = ray.from + left * ray.to;
          if (scene.monitors.size() > 1 && ray.to.x() < 0.0 && on_left.z() > 0.0) {
            add(1, channel, kLeftTop - on_left.z(), on_left.y(), ray.light);
          } else if (ray.to.z() < 0.0) {
            const Vec on_back = ray.from - ray.from.z() / ray.to.z() * ray.to;
            add(0, channel, on_back.x(), on_back.y(), ray.light);
          }
        }
      };
      for (int i = 0; i < rays * rays; ++i) {
        const double x = 2.0 * (column + (i % rays + 0.5) / rays), y = 2.0 * (row + (i / rays + 0.5) / rays);
        for (size_t channel = 0; channel < 3; ++channel) trace(x, y, channel);
      }
      const size_t pixel = row * scene.camera.width_px + column;
      scene.inside[pixel] = covered > 0.5;
      View& view = scene.object[pixel] = {};
      for (size_t c = 0; c < 3; ++c) view.foreground[c] = covered * foreground[c];
      for (const auto& [at, part] : light) {
        const auto& [monitor, channel, y, x] = at;
        if (view.paths.empty() || view.paths.back().monitor != monitor ||
            view.paths.back().tint[channel] == 0.0) {
          view.paths.push_back({.monitor = monitor, .tint = {}, .shares = {}});
          view.paths.back().tint[channel] = 1.0;
        }
        view.paths.back().shares.push_back({x, y, part});
      }
    }
  }
}

// A ball of water between two monitors: the one behind upside down, that at the left in its rim.
Scene ball() {
  Scene scene = empty_scene("ball", {"gaussian", "hierarchical", "fringe"}, 2);
  const Vec centre(32.0, 24.0, 70.0);
  constexpr double kRadius = 18.0;
  constexpr std::array<double, 3> kIndex{1.331, 1.335, 1.340};
  put_object(scene, 8, {}, [=](double x, double y, size_t channel) -> std::optional<std::vector<Ray>> {
    const double across = x - centre.x(), down = y - centre.y();
    const double square = kRadius * kRadius - across * across - down * down;
    if (square <= 0.0) return std::nullopt;
    const Vec d(0.0, 0.0, -1.0), n = Vec(across, down, std::sqrt(square)) / kRadius,
                                 in = centre + kRadius * n;
    const Vec inside = *refracted(d, n, 1.0 / kIndex[channel]);
    const double off = reflectance(d, inside, n, 1.0 / kIndex[channel]);
    std::vector<Ray> leaving{{.from = in, .to = d - 2.0 * d.dot(n) * n, .light = off}};
    const Vec out = in - 2.0 * inside.dot(in - centre) * inside, m = (centre - out) / kRadius;
    const Vec beyond = *refracted(inside, m, kIndex[channel]);
    leaving.push_back({.from = out,
                       .to = beyond,
                       .light = (1.0 - off) * (1.0 - reflectance(inside, beyond, m, kIndex[channel]))});
    return leaving;
  });
  return scene;
}

// A ray that left a plate `height` above the monitor through a face of this slope.
std::optional<std::vector<Ray>> through(double x, double y, double height, double slope_x, double slope_y,
                                        double index) {
  const Vec d(0.0, 0.0, -1.0), n = Vec(slope_x, slope_y, 1.0).normalized();
  const auto beyond = refracted(d, n, index);
  if (!beyond) return std::vector<Ray>{};
  const double off = reflectance(d, *beyond, n, index);
  return std::vector<Ray>{{.from = Vec(x, y, height), .to = *beyond, .light = 0.96 * (1.0 - off)}};
}

// A prism like a roof, of flint glass that bends the channels differently, on coloured ground.
Scene prism() {
  Scene scene = empty_scene("prism", {"gaussian", "few", "hierarchical", "fringe", "ramp"});
  put_object(scene, 8, {0.04, 0.02, 0.06},
             [](double x, double y, size_t channel) -> std::optional<std::vector<Ray>> {
               if (std::abs(x - 32.0) > 22.5 || std::abs(y - 24.0) > 16.5) return std::nullopt;
               constexpr std::array<double, 3> kIndex{1.60, 1.63, 1.66};
               return through(x, y, 40.0, x < 32.0 ? -0.3 : 0.3, 0.1, kIndex[channel]);
             });
  return scene;
}

// A brushed plate of glass, a weak lens, that scatters light five times further along than across.
Scene plate() {
  Scene scene = empty_scene("plate", {"gaussian", "hierarchical"});
  std::mt19937 random(9);
  put_object(scene, 24, {0.02, 0.02, 0.02},
             [&](double x, double y, size_t) -> std::optional<std::vector<Ray>> {
               if (std::abs(x - 32.0) > 24.5 || std::abs(y - 24.0) > 18.5) return std::nullopt;
               // Two normal numbers (Box and Muller 1958).
               const double radius = std::sqrt(-2.0 * std::log(uniform(random))),
                            turn = 2.0 * std::numbers::pi * uniform(random);
               const double along = 0.10 * radius * std::cos(turn), across = 0.02 * radius * std::sin(turn);
               const double c = std::cos(0.06 * y), s = std::sin(0.06 * y);
               return through(x, y, 50.0, 0.01 * (x - 32.0) + c * along - s * across,
                              0.012 * (y - 24.0) + s * along + c * across, 1.5);
             });
  return scene;
}

}  // namespace

std::vector<Scene> traced_scenes() {
  return {ball(), prism(), plate()};
}

}  // namespace glasswing::gate
