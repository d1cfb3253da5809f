// A simulated camera that sees the ramp through a lens, with known c, rho and f.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "solver/ramp/ramp_extractor.h"

namespace glasswing {

struct RampTruth {
  bool object = false;
  double x_px = 0.0, y_px = 0.0, rho = 1.0, f = 0.0;
};

struct RampScene {
  int width_px = 160, height_px = 120;  // of camera and monitor
  double read_sd = 0.0;
  std::array<double, 3> gain{1.0, 1.0, 1.0};  // of the camera's channels
  // Behind the camera pixel's centre, monitor px.
  std::function<std::array<double, 2>(double, double)> behind = [](double x, double y) {
    return std::array<double, 2>{x, y};
  };

  v1::CaptureManifest manifest() const {
    v1::CaptureManifest manifest;
    manifest.set_format_version(1);
    manifest.set_session("lens");
    manifest.mutable_camera()->set_width_px(width_px);
    manifest.mutable_camera()->set_height_px(height_px);
    manifest.mutable_camera()->set_bits(16);
    manifest.mutable_camera()->set_read_sd(read_sd);
    v1::Monitor& monitor = *manifest.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(width_px);
    monitor.set_height_px(height_px);
    return manifest;
  }

  // Black beyond the monitor.
  std::array<double, 3> ramp(double x, double y) const {
    const double u = x / width_px, v = y / height_px;
    if (u < 0.0 || u > 1.0 || v < 0.0 || v > 1.0) return {};
    return {gain[0] * (0.1 + 0.8 * u), gain[1] * (0.1 + 0.8 * v), gain[2] * (0.9 - 0.4 * u - 0.4 * v)};
  }

  // A disc that shows the ramp's middle, smaller and rotated.
  RampTruth lens(int x, int y) const {
    const double dx = x + 0.5 - 0.45 * width_px, dy = y + 0.5 - 0.55 * height_px;
    const bool object = std::hypot(dx, dy) < 0.3 * height_px;
    if (!object) return {};
    return {.object = true,
            .x_px = 0.5 * width_px - 0.6 * dx + 0.2 * dy,
            .y_px = 0.5 * height_px - 0.2 * dx - 0.6 * dy,
            .rho = 0.8};
  }

  using Truth = std::function<RampTruth(int, int)>;
  std::vector<std::uint16_t> frame(const Truth& truth, unsigned seed = 1) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<std::uint16_t> samples;
    for (int y = 0; y < height_px; ++y) {
      for (int x = 0; x < width_px; ++x) {
        const RampTruth here = truth(x, y);
        const auto [bx, by] = behind(x + 0.5, y + 0.5);
        const std::array<double, 3> light = here.object ? ramp(here.x_px, here.y_px) : ramp(bx, by);
        for (size_t c = 0; c < 3; ++c) {
          const double seen = (here.object ? here.rho : 1.0) * light[c] + here.f + read_sd * noise(random);
          samples.push_back(static_cast<std::uint16_t>(std::lround(65535.0 * std::clamp(seen, 0.0, 1.0))));
        }
      }
    }
    return samples;
  }
  std::vector<std::uint16_t> empty(unsigned seed = 99) const {
    return frame([](int, int) { return RampTruth{}; }, seed);
  }
  FrameView view(const std::vector<std::uint16_t>& samples) const {
    return {.width_px = width_px, .height_px = height_px, .samples = samples};
  }

  absl::StatusOr<RampExtractor> extractor(const RampOptions& options = {}, int empties = 1) const {
    std::vector<std::vector<std::uint16_t>> frames;
    std::vector<FrameView> views;
    for (int i = 0; i < empties; ++i) frames.push_back(empty(100 + static_cast<unsigned>(i)));
    for (const auto& each : frames) views.push_back(view(each));
    return RampExtractor::create(manifest(), {}, views, options);
  }
};

}  // namespace glasswing
