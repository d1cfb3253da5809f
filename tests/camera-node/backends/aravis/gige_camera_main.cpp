// A GigE Vision camera (gige_camera.h) that sees the monitors of a display node through a scene, until it is
// terminated.
#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>
#include <iostream>

#include "camera-node/backends/emission_client.h"
#include "core/telemetry/logs.h"
#include "tests/camera-node/backends/aravis/gige_camera.h"
#include "tests/vm/camera_code.h"
#include "tests/vm/scene_view.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  CLI::App app("A GigE Vision camera that sees what a display node shows.");
  std::string tap, object, scene = "crystal", address = "127.0.0.1", serial = "1";
  double lost_percent = 0.0;
  app.add_option("--tap", tap, "HOST:PORT of the display node whose light it sees")->required();
  app.add_option("--object", object, "the object is in view while this file exists")->required();
  app.add_option("--scene", scene)->capture_default_str();
  app.add_option("--address", address, "of this machine, at which it answers")->capture_default_str();
  app.add_option("--serial", serial)->capture_default_str();
  app.add_option("--lost", lost_percent, "% of the packets that it loses")->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
  start_logging("gige_camera", LogOptions());
  EmissionTimeline timeline(std::chrono::seconds(60));
  const EmissionClient client(tap, timeline);
  std::optional<SceneView> view;
  int width_px = 0, height_px = 0;
  const GigeCamera camera(address, serial, lost_percent / 100.0, [&](const GigeCamera::Exposure& exposure) {
    if (exposure.width_px != width_px || exposure.height_px != height_px) {
      width_px = exposure.width_px;
      height_px = exposure.height_px;
      view.emplace(scene, width_px, height_px, kFullScaleExposure_ms);
    }
    sleep_until_monotonic(exposure.start + exposure.length);
    return view->expose(timeline, {.start = exposure.start, .exposure = exposure.length},
                        std::filesystem::exists(object));
  });
  if (!camera.is_running()) {
    std::cerr << address << " cannot be listened at\n";
    return 1;
  }
  int signal = 0;
  sigwait(&ends, &signal);
  return 0;
}
