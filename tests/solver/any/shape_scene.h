// Scenes of light of any shape on one monitor, and their mattes. Truth is by brute force: sums over the
// monitor's flat pixels (tests/gate/light.h).
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/gate/scene.h"
#include "tests/solver/stack_of.h"
#include "tests/support/status.h"

namespace glasswing::any_shape {

using Shape = std::function<double(double, double)>;  // brightness, from the shape's middle

constexpr gate::Size kMonitor{128, 96};

inline gate::Shares shares_of(const Shape& shape, double x_px, double y_px) {
  constexpr int kSide = 5;  // samples across a pixel
  gate::Shares shares;
  double sum = 0.0;
  for (int y = 0; y < kMonitor.height_px; ++y) {
    for (int x = 0; x < kMonitor.width_px; ++x) {
      double light = 0.0;
      for (int i = 0; i < kSide * kSide; ++i)
        light += shape(x + (i % kSide + 0.5) / kSide - x_px, y + (i / kSide + 0.5) / kSide - y_px);
      if (light < 1e-6) continue;
      shares.push_back({x, y, light});
      sum += light;
    }
  }
  for (gate::Share& share : shares) share.part /= sum;
  return shares;
}

// Two rows of camera pixels without an object.
inline gate::Scene two_rows(const std::string& name, int width_px) {
  gate::Scene scene = gate::empty_scene(name, {});
  scene.camera = {width_px, 2};
  scene.monitors = {kMonitor};
  scene.empty.clear();
  for (int i = 0; i < 2 * width_px; ++i) {
    const gate::Box behind{.x_px = 6.0 * (i % width_px) + 5.0,
                           .y_px = 6.0 * (i / width_px) + 30.0,
                           .width_px = 2.0,
                           .height_px = 2.0};
    scene.empty.push_back(
        {.foreground = {}, .paths = {{.tint = {1, 1, 1}, .shares = gate::shares_of(behind, kMonitor)}}});
  }
  scene.object = scene.empty;
  scene.inside.assign(scene.empty.size(), false);
  return scene;
}

inline void put(gate::Scene& scene, size_t pixel, const gate::Shares& shares) {
  scene.object[pixel] = {.foreground = {0.02, 0.02, 0.02},
                         .paths = {{.tint = {0.6, 0.6, 0.6}, .shares = shares}}};
  scene.inside[pixel] = true;
}

// `plan`: as text.
inline Matte solved(const gate::Scene& scene, const std::string& plan, double noise_sd,
                    const MethodOptions& options) {
  gate::Recording recording = gate::recorded(scene, plan);
  recording.manifest.mutable_camera()->set_read_sd(std::max(noise_sd, 1e-5));
  const std::vector<Image16> frames = gate::noisy(recording.frames, noise_sd);
  auto matte = solve_in_bands(*make_method("gaussian", options).value(), recording.manifest,
                              stack_of(recording.manifest, frames));
  EXPECT_OK(matte);
  return *std::move(matte);
}

}  // namespace glasswing::any_shape
