// The sensor of the simulated USB camera (usb_camera): for each line "START_NS EXPOSURE_NS" it writes the
// picture that a global shutter took then of the monitors through a scene, as YUYV. It gets the monitors'
// light from a display node's tap.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "camera-node/backends/emission_client.h"
#include "core/service/service.h"
#include "core/telemetry/logs.h"
#include "tests/vm/camera_code.h"
#include "tests/vm/scene_view.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  CLI::App app("The sensor of the USB camera of tests/vm.");
  std::string tap, object, scene = "crystal";
  int width_px = 64, height_px = 48;
  app.add_option("--tap", tap, "HOST:PORT of the display node whose light it sees")->required();
  app.add_option("--object", object, "the object is in view while this file exists")->required();
  app.add_option("--scene", scene)->capture_default_str();
  app.add_option("--width", width_px)->capture_default_str();
  app.add_option("--height", height_px)->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  start_logging("usb_camera_sensor", LogOptions());  // to stderr; stdout carries the pictures
  EmissionTimeline timeline(std::chrono::seconds(60));
  const EmissionClient client(tap, timeline);
  SceneView view(scene, width_px, height_px, kFullScaleExposure_ms);
  std::int64_t start_ns = 0, exposure_ns = 0;
  while (std::cin >> start_ns >> exposure_ns) {
    const ExposureWindow window{.start = nanoseconds(start_ns), .exposure = nanoseconds(exposure_ns)};
    const Image16 seen = view.expose(timeline, window, std::filesystem::exists(object));
    const std::vector<std::uint8_t> bytes = yuyv_of(seen);
    std::cout.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    std::cout.flush();
  }
  return 0;
}
