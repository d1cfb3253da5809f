#include "tests/gate/scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "core/pattern/plan.h"

namespace glasswing::gate {

Scene empty_scene(const std::string& name, const std::vector<std::string>& methods, int monitor_count) {
  Scene scene{.name = name, .methods = methods, .monitors = {}, .empty = {}, .object = {}, .inside = {}};
  scene.monitors.push_back({2 * scene.camera.width_px, 2 * scene.camera.height_px});
  // At the sides of it.
  for (int i = 1; i < monitor_count; ++i) scene.monitors.push_back({40, 2 * scene.camera.height_px});
  for (int y = 0; y < scene.camera.height_px; ++y) {
    for (int x = 0; x < scene.camera.width_px; ++x) {
      const Box behind{.x_px = 2.0 * x + 1.0, .y_px = 2.0 * y + 1.0, .width_px = 2.0, .height_px = 2.0};
      scene.empty.push_back(
          {.foreground = {}, .paths = {{.tint = {1, 1, 1}, .shares = shares_of(behind, scene.monitors[0])}}});
    }
  }
  scene.object = scene.empty;
  scene.inside.resize(scene.empty.size());
  return scene;
}

RadianceImage photograph(const Scene& scene, bool object, const std::vector<RadianceImage>& shown) {
  RadianceImage picture(scene.camera.width_px, scene.camera.height_px);
  const std::vector<View>& views = object ? scene.object : scene.empty;
  for (size_t pixel = 0; pixel < views.size(); ++pixel) {
    for (size_t c = 0; c < 3; ++c) {
      double light = views[pixel].foreground[c];
      for (const Path& path : views[pixel].paths) {
        const RadianceImage& on = shown[path.monitor];
        if (path.tint[c] > 0.0 && !on.empty())
          light += path.tint[c] * seen(path.shares, on, static_cast<int>(c));
      }
      picture.samples[3 * pixel + c] = static_cast<float>(light);
    }
  }
  return picture;
}

std::vector<RadianceImage> pictures(const Scene& scene, const std::string& name) {
  std::mt19937 random(7);
  std::vector<RadianceImage> all;
  for (size_t monitor = 0; monitor < scene.monitors.size(); ++monitor) {
    RadianceImage& picture =
        all.emplace_back(scene.monitors[monitor].width_px, scene.monitors[monitor].height_px);
    for (int y = 0; y < picture.height_px; ++y) {
      for (int x = 0; x < picture.width_px; ++x) {
        for (int c = 0; c < 3; ++c) {
          const double turn = static_cast<double>(c) + 2.0 * static_cast<double>(monitor);
          double light = 0.0;
          if (name == "waves") {
            light = 0.5 + 0.25 * std::sin(0.23 * x + 0.11 * y + turn) +
                    0.25 * std::cos(0.09 * x - 0.31 * y - turn);
          } else if (name == "checks") {
            light = (x / 4 + y / 4 + c) % 2 == 0 ? 0.9 : 0.1;
          } else if (name == "grain") {
            light = static_cast<double>(random() % 1024) / 1023.0;
          } else {
            throw std::invalid_argument("no picture " + name);
          }
          picture.at(x, y, c) = static_cast<float>(light);
        }
      }
    }
  }
  return all;
}

Recording recorded(const Scene& scene, const std::string& plan) {
  Recording recording;
  v1::CaptureManifest& manifest = recording.manifest;
  manifest.set_format_version(1);
  manifest.set_session(scene.name);
  *manifest.mutable_plan() = parse_plan(plan, scene.name).value();
  v1::Camera& camera = *manifest.mutable_camera();
  camera.set_width_px(scene.camera.width_px);
  camera.set_height_px(scene.camera.height_px);
  camera.set_bits(16);
  camera.set_response("linear");
  for (size_t i = 0; i < scene.monitors.size(); ++i) {
    v1::Monitor& monitor = *manifest.add_monitors();
    monitor.set_name(std::array{"back", "left", "right"}[i]);
    monitor.set_width_px(scene.monitors[i].width_px);
    monitor.set_height_px(scene.monitors[i].height_px);
  }
  const std::vector<v1::Monitor> rig(manifest.monitors().begin(), manifest.monitors().end());
  const std::vector<Step> steps = expand(manifest.plan(), rig).value();
  for (const Step& step : steps) {
    v1::Frame& frame = *manifest.add_frames();
    frame.set_file("frames/" + std::to_string(step.number) + ".tif");
    frame.set_object(step.object);
    frame.set_step(step.number);
    frame.set_exposure_ms(step.exposure_ms);
    *frame.mutable_stimulus() = step.stimulus;
    std::vector<RadianceImage> shown(scene.monitors.size());
    const size_t lit = std::distance(
        rig.begin(),
        std::ranges::find(rig, step.stimulus.panel(), [](const auto& one) { return one.name(); }));
    shown.at(lit) = drawn(step.stimulus, scene.monitors.at(lit));
    recording.frames.push_back(photograph(scene, step.object, shown));
  }
  return recording;
}

std::vector<Image16> noisy(const std::vector<RadianceImage>& frames, double noise_sd) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<Image16> all;
  for (const RadianceImage& frame : frames) {
    Image16& image = all.emplace_back(frame.width_px, frame.height_px);
    for (size_t i = 0; i < frame.samples.size(); ++i) {
      const double light = static_cast<double>(frame.samples[i]) + noise_sd * normal(random);
      image.samples[i] = static_cast<std::uint16_t>(std::lround(65535.0 * std::clamp(light, 0.0, 1.0)));
    }
  }
  return all;
}

double psnr(const Scene& scene, const RadianceImage& composite, const RadianceImage& truth) {
  double squares = 0.0, count = 0.0;
  for (size_t i = 0; i < truth.samples.size(); ++i) {
    if (!scene.inside[i / 3]) continue;
    const double light = std::clamp(static_cast<double>(composite.samples[i]), 0.0, 1.0);
    squares += std::pow(light - static_cast<double>(truth.samples[i]), 2.0);
    count += 1.0;
  }
  return -10.0 * std::log10(squares / count);
}

}  // namespace glasswing::gate
