// A GigE Vision camera (wire_camera.h) that sees the monitors of a display node through a scene, or shows one
// random picture again and again, until it is terminated. Then it prints what it did.
#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <random>

#include "camera-node/backends/emission_client.h"
#include "core/telemetry/logs.h"
#include "tests/camera-node/backends/aravis/wire_camera.h"
#include "tests/vm/camera_code.h"
#include "tests/vm/scene_view.h"

namespace {

using namespace glasswing;

std::shared_ptr<const Image16> random_picture(PictureSize size) {
  auto image = std::make_shared<Image16>(size.width_px, size.height_px, 1);
  std::mt19937 random(1);
  for (std::uint16_t& sample : image->samples) sample = static_cast<std::uint16_t>(random());
  return image;
}

// Moves this thread: the sockets that it opens from now on are of that network.
bool enter_network(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool entered = fd >= 0 && ::setns(fd, CLONE_NEWNET) == 0;
  ::close(fd);
  return entered;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("A GigE Vision camera with packed formats, resent packets, chunks, PTP and a trigger line.");
  std::string tap, network, object, scene = "crystal", line_port_file;
  WireCamera::Options options;
  double lost_percent = 0.0, period_ms = 0.0, latency_ms = 0.1;
  bool silent = false;
  app.add_option("--tap", tap,
                 "HOST:PORT of the display node whose light it sees; without, a random picture");
  app.add_option("--object", object, "the object is in view while this file exists");
  app.add_option("--scene", scene)->capture_default_str();
  app.add_option("--network", network,
                 "a file such as /proc/PID/ns/net: the network namespace in which it answers");
  app.add_option("--address", options.address, "of this machine, at which it answers")->capture_default_str();
  app.add_option("--serial", options.serial)->capture_default_str();
  app.add_option("--lost", lost_percent, "% of the packets that it loses")->capture_default_str();
  app.add_option("--clock-ppm", options.clock_ppm, "by which its clock is fast");
  app.add_option("--period-ms", period_ms, "from a triggered exposure to the next one, at least");
  app.add_option("--latency-ms", latency_ms, "from a software trigger to its exposure")
      ->capture_default_str();
  app.add_option("--bytes-per-s", options.bytes_per_s, "that it sends at most");
  app.add_flag("--no-resends", silent, "packets are not sent again");
  app.add_option("--line-port", line_port_file,
                 "a file for the UDP port of which each datagram raises Line1");
  CLI11_PARSE(app, argc, argv);
  options.lost = lost_percent / 100.0;
  options.resends = !silent;
  options.min_period = nanoseconds(static_cast<std::int64_t>(period_ms * 1e6));
  options.trigger_latency = nanoseconds(static_cast<std::int64_t>(latency_ms * 1e6));

  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
  start_logging("wire_camera", LogOptions());
  EmissionTimeline timeline(std::chrono::seconds(60));
  std::optional<EmissionClient> client;
  if (!tap.empty()) client.emplace(tap, timeline);
  if (!network.empty() && !enter_network(network)) {
    std::cerr << network << " cannot be entered\n";
    return 1;
  }
  std::optional<SceneView> view;
  std::shared_ptr<const Image16> still;
  PictureSize seen;
  const WireCamera camera(options, [&](const WireCamera::Exposure& exposure) {
    if (PictureSize{exposure.width_px, exposure.height_px} != seen) {
      seen = {exposure.width_px, exposure.height_px};
      if (client)
        view.emplace(scene, seen.width_px, seen.height_px, kFullScaleExposure_ms);
      else
        still = random_picture(seen);
    }
    if (!client) return still;
    return std::shared_ptr<const Image16>(std::make_shared<Image16>(view->expose(
        timeline, {.start = exposure.start, .exposure = exposure.length}, std::filesystem::exists(object))));
  });
  if (!camera.is_running()) {
    std::cerr << options.address << " cannot be listened at\n";
    return 1;
  }
  if (!line_port_file.empty()) std::ofstream(line_port_file) << camera.line_port() << "\n";
  int signal = 0;
  sigwait(&ends, &signal);
  const WireCamera::Counts did = camera.counts();
  std::cout << fmt::format("exposed {} ignored {} overrun {} packets {} lost {} resent {}\n", did.exposed,
                           did.ignored, did.overrun, did.packets, did.lost, did.resent);
  return 0;
}
