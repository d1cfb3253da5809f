// The sensor of the simulated USB camera (usb_camera): for each line "START_NS EXPOSURE_NS" it writes the
// picture that a global shutter took then of the monitors through a scene, as YUYV. It gets the monitors'
// light from a display node's tap.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <optional>

#include "camera-node/backends/emission_client.h"
#include "core/service/service.h"
#include "core/sim/sensor.h"
#include "core/telemetry/logs.h"
#include "tests/vm/camera_code.h"

namespace {

using namespace glasswing;

constexpr nanoseconds kPatience = std::chrono::seconds(5);  // the camera drops late frames

struct Scene {
  std::string name;
  int width_px = 0, height_px = 0;
  std::vector<SceneMonitor> monitors;
  std::optional<Transport> with, without;  // with the object, without it

  const Transport& transport(const std::vector<MonitorEmission>& emission, bool object) {
    std::optional<Transport>& through = object ? with : without;
    if (!through) {
      std::vector<SceneMonitor> lit;
      for (const MonitorEmission& each : emission)
        lit.push_back({.name = each.monitor.name, .size = {each.monitor.width_px, each.monitor.height_px}});
      through = build_transport(name, object, lit, width_px, height_px).value();
    }
    return *through;
  }
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The sensor of the USB camera of tests/vm.");
  std::string tap, object;
  Scene scene{.name = "crystal", .width_px = 64, .height_px = 48, .monitors = {}, .with = {}, .without = {}};
  app.add_option("--tap", tap, "HOST:PORT of the display node whose light it sees")->required();
  app.add_option("--object", object, "the object is in view while this file exists")->required();
  app.add_option("--scene", scene.name)->capture_default_str();
  app.add_option("--width", scene.width_px)->capture_default_str();
  app.add_option("--height", scene.height_px)->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  start_logging("usb_camera_sensor", LogOptions());  // to stderr; stdout carries the pictures
  EmissionTimeline timeline(std::chrono::seconds(60));
  const EmissionClient client(tap, timeline);
  SensorModel sensor;
  sensor.read_sd = sensor.gain = 0.0;
  sensor.bits = 16;
  sensor.full_scale_exposure_ms = kFullScaleExposure_ms;
  std::int64_t start_ns = 0, exposure_ns = 0, number = 0;
  while (std::cin >> start_ns >> exposure_ns) {
    const ExposureWindow window{.start = nanoseconds(start_ns), .exposure = nanoseconds(exposure_ns)};
    const nanoseconds end = window.start + window.exposure;
    Image16 seen(scene.width_px, scene.height_px);
    const auto emission =
        timeline.wait_known_until(end, kPatience) ? timeline.between(window.start, end) : std::nullopt;
    if (emission) {
      const Transport& through = scene.transport(*emission, std::filesystem::exists(object));
      seen = expose(integrate(through, *emission, window, nanoseconds(0)),
                    static_cast<double>(exposure_ns) / 1e6, sensor, ++number);
    }
    const std::vector<std::uint8_t> bytes = yuyv_of(seen);
    std::cout.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    std::cout.flush();
  }
  return 0;
}
