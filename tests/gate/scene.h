// Small scenes that are known exactly: for every camera pixel, the share of each monitor pixel in its light.
// Frames and the photographs that composites are compared with are sums of light times share.
#pragma once

#include <array>
#include <random>
#include <string>
#include <vector>

#include "solver/method/method.h"
#include "tests/gate/light.h"

namespace glasswing::gate {

// Light that reaches a camera pixel from one monitor.
struct Path {
  int monitor = 0;
  std::array<double, 3> tint{1.0, 1.0, 1.0};  // of the channels
  Shares shares;
};

struct View {
  std::array<double, 3> foreground{};
  std::vector<Path> paths;
};

struct Scene {
  std::string name;
  std::vector<std::string> methods;  // as in scene_test.cpp
  Size camera{.width_px = 32, .height_px = 24};
  std::vector<Size> monitors;       // the first is behind the object
  std::vector<View> empty, object;  // by pixel; without and with the object
  std::vector<bool> inside;         // the object covers more than half of the pixel
};

// Where nothing covers them, pixels see 2x2 px each of the first monitor, which is twice as large.
Scene empty_scene(const std::string& name, const std::vector<std::string>& methods, int monitor_count = 1);

// Each pixel is that of one footprint, or of several.
std::vector<Scene> analytic_scenes();
// Each pixel is that of many rays through glass.
std::vector<Scene> traced_scenes();

// In (0, 1).
inline double uniform(std::mt19937& random) {
  return (static_cast<double>(random()) + 0.5) / 4294967296.0;
}

// What the camera sees if the monitors show these pictures; an empty picture is black.
RadianceImage photograph(const Scene& scene, bool object, const std::vector<RadianceImage>& shown);

// The pictures that the monitors show behind composites: "waves" (smooth), "checks" (of 4 px) or "grain"
// (every pixel its own colour).
std::vector<RadianceImage> pictures(const Scene& scene, const std::string& name);

// The recorded frames of a plan, without noise.
struct Recording {
  v1::CaptureManifest manifest;
  std::vector<RadianceImage> frames;  // in the manifest's order
};
Recording recorded(const Scene& scene, const std::string& plan);

// The frames on 16 bits with Gaussian noise of this standard deviation, the same in every run.
std::vector<Image16> noisy(const std::vector<RadianceImage>& frames, double noise_sd);

// dB, light of full scale 1, inside the object.
double psnr(const Scene& scene, const RadianceImage& composite, const RadianceImage& truth);

}  // namespace glasswing::gate
