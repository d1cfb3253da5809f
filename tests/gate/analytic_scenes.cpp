#include <cmath>
#include <functional>
#include <random>

#include "tests/gate/scene.h"

namespace glasswing::gate {
namespace {

class Random {
 public:
  explicit Random(unsigned seed) : random_(seed) {}
  double in(double low, double high) { return low + (high - low) * uniform(random_); }

 private:
  std::mt19937 random_;
};

// Replaces the views of an ellipse in the middle. `at` runs from -1 to 1 across it, and down.
void put_object(Scene& scene, const std::function<View(double x, double y)>& view) {
  for (int row = 0; row < scene.camera.height_px; ++row) {
    for (int column = 0; column < scene.camera.width_px; ++column) {
      const double x = (2.0 * column + 1.0) / scene.camera.width_px - 1.0,
                   y = (2.0 * row + 1.0) / scene.camera.height_px - 1.0;
      const size_t pixel = row * scene.camera.width_px + column;
      scene.inside[pixel] = std::hypot(x, y) < 0.8;
      if (scene.inside[pixel]) scene.object[pixel] = view(x / 0.8, y / 0.8);
    }
  }
}

// A lens of gray glass: one footprint a pixel, its place and slant smooth.
Scene lens() {
  Scene scene = empty_scene("lens", {"gaussian", "few", "hierarchical", "fringe", "ramp"});
  put_object(scene, [&](double x, double y) {
    const Gaussian one =
        gaussian({32.0 - 21.0 * x + 3.0 * y, 24.0 - 3.0 * x - 15.0 * y, 1.4 + 0.6 * x, 0.8, 50.0 * y});
    return View{.foreground = {0.02, 0.02, 0.02},
                .paths = {{.tint = {0.8, 0.8, 0.8}, .shares = shares_of(one, scene.monitors[0])}}};
  });
  return scene;
}

// Facets: every channel sees four places of its own, of different brightness.
Scene facets() {
  Scene scene = empty_scene("facets", {"gaussian", "few"});
  Random random(2);
  put_object(scene, [&](double, double) {
    View view;
    for (int quarter = 0; quarter < 4; ++quarter) {
      const double x = 16.0 + 32.0 * (quarter % 2) + random.in(-7.0, 7.0),
                   y = 13.0 + 22.0 * (quarter / 2) + random.in(-5.0, 5.0);
      for (size_t c = 0; c < 3; ++c) {
        const Gaussian own = gaussian({x + static_cast<double>(c), y - 0.5 * static_cast<double>(c),
                                       random.in(1.0, 2.5), random.in(0.7, 1.0), random.in(-90.0, 90.0)});
        Path path{.tint = {}, .shares = shares_of(own, scene.monitors[0])};
        path.tint[c] = random.in(0.1, 0.24);
        view.paths.push_back(std::move(path));
      }
    }
    return view;
  });
  return scene;
}

// Footprints that edges and corners cut, or whose centres lie beyond them.
Scene edges() {
  Scene scene = empty_scene("edges", {"gaussian", "fringe"});
  Random random(3);
  put_object(scene, [&](double x, double y) {
    const double along = random.in(2.0, 9.0), across = random.in(1.5, 4.0);
    const Gaussian one = gaussian({32.0 + 36.0 * x, 24.0 + 28.0 * y, along, across, random.in(-90.0, 90.0)});
    return View{.foreground = {},
                .paths = {{.tint = {0.9, 0.8, 0.7}, .shares = shares_of(one, scene.monitors[0])}}};
  });
  return scene;
}

// Brushed metal: long and narrow at any angle, with coloured light of its own.
Scene brushed() {
  Scene scene = empty_scene("brushed", {"gaussian", "hierarchical", "fringe"});
  Random random(4);
  put_object(scene, [&](double x, double y) {
    const Gaussian one = gaussian(
        {32.0 + 14.0 * x, 24.0 - 9.0 * y, random.in(4.0, 7.0), random.in(0.8, 1.2), random.in(-90.0, 90.0)});
    return View{.foreground = {0.12, 0.07, 0.02},
                .paths = {{.tint = {0.7, 0.6, 0.45}, .shares = shares_of(one, scene.monitors[0])}}};
  });
  return scene;
}

// Frosted plastic with a dim gloss: a broad footprint, and a sharp one of two to six percent.
Scene frosted() {
  Scene scene = empty_scene("frosted", {"gaussian", "hierarchical"});
  Random random(5);
  put_object(scene, [&](double x, double y) {
    const Gaussian broad = gaussian(
                       {32.0 + 8.0 * x, 24.0 + 6.0 * y, random.in(6.0, 12.0), 6.0, random.in(-90.0, 90.0)}),
                   sharp = gaussian({random.in(8.0, 56.0), random.in(8.0, 40.0), 1.0, 1.0, 0.0});
    const double gloss = random.in(0.02, 0.06);
    return View{.foreground = {0.01, 0.02, 0.04},
                .paths = {{.tint = {0.4, 0.5, 0.6}, .shares = shares_of(broad, scene.monitors[0])},
                          {.tint = {gloss, gloss, gloss}, .shares = shares_of(sharp, scene.monitors[0])}}};
  });
  return scene;
}

// Two places of the monitor behind, and one of each at the sides, weaker.
Scene panels() {
  Scene scene = empty_scene("panels", {"gaussian", "hierarchical", "fringe"}, 3);
  Random random(6);
  put_object(scene, [&](double x, double y) {
    View view{.foreground = {0.03, 0.02, 0.01}, .paths = {}};
    const auto add = [&](int monitor, double weight, double at_x, double at_y) {
      const Gaussian one = gaussian({at_x, at_y, random.in(1.0, 2.5), 0.9, random.in(-90.0, 90.0)});
      view.paths.push_back({.monitor = monitor,
                            .tint = {weight, 0.9 * weight, 0.8 * weight},
                            .shares = shares_of(one, scene.monitors[monitor])});
    };
    add(0, 0.5, 20.0 + 12.0 * x, 24.0 + 14.0 * y);
    if (y < 0.0) add(0, 0.2, 48.0 - 10.0 * x, 24.0 - 14.0 * y);
    if (x < 0.3) add(1, 0.15, 20.0 - 14.0 * x, 24.0 + 16.0 * y);
    if (x > -0.3) add(2, 0.10, 20.0 + 14.0 * x, 24.0 - 16.0 * y);
    return view;
  });
  return scene;
}

// One box a pixel; below the middle half of what is straight behind shines through.
Scene boxes() {
  Scene scene = empty_scene("boxes", {"gaussian", "hierarchical"});
  Random random(8);
  put_object(scene, [&](double x, double y) {
    const Box one{.x_px = 32.0 - 24.0 * x,
                  .y_px = 24.0 - 17.0 * y,
                  .width_px = random.in(1.0, 9.0),
                  .height_px = random.in(1.0, 7.0)};
    View view{.foreground = {0.05, 0.03, 0.04},
              .paths = {{.tint = {0.45, 0.4, 0.35}, .shares = shares_of(one, scene.monitors[0])}}};
    if (y > 0.0) {
      const Box behind{.x_px = 32.0 + 25.6 * x, .y_px = 24.0 + 19.2 * y, .width_px = 2.0, .height_px = 2.0};
      view.paths.push_back({.tint = {0.5, 0.5, 0.5}, .shares = shares_of(behind, scene.monitors[0])});
    }
    return view;
  });
  return scene;
}

// A film over what is straight behind, of coloured light: a conventional matte.
Scene film() {
  Scene scene = empty_scene("film", {"alpha", "gaussian", "hierarchical"});
  put_object(scene, [&](double x, double y) {
    const double through = 0.5 + 0.4 * x * y;
    const Box behind{.x_px = 32.0 + 25.6 * x, .y_px = 24.0 + 19.2 * y, .width_px = 2.0, .height_px = 2.0};
    return View{
        .foreground = {0.3 - 0.1 * x, 0.2, 0.1 + 0.08 * y},
        .paths = {{.tint = {through, through, through}, .shares = shares_of(behind, scene.monitors[0])}}};
  });
  return scene;
}

}  // namespace

std::vector<Scene> analytic_scenes() {
  return {lens(), facets(), edges(), brushed(), frosted(), panels(), boxes(), film()};
}

}  // namespace glasswing::gate
