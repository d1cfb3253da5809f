// How many frames of 5 megapixels with 12 packed bits, 30 a second, arrive from a camera on this machine
// (wire_camera.h): prints rows as tests/goals.toml describes them, and a line for people on standard error.
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <random>

#include "camera-node/backends/aravis/aravis_camera.h"
#include "core/telemetry/logs.h"
#include "tests/camera-node/backends/aravis/wire_camera.h"

namespace {

using namespace glasswing;
constexpr PictureSize kSize{2592, 1944};

std::shared_ptr<const Image16> random_picture() {
  auto image = std::make_shared<Image16>(kSize.width_px, kSize.height_px, 1);
  std::mt19937 random(1);
  for (std::uint16_t& sample : image->samples) sample = static_cast<std::uint16_t>(random());
  return image;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Frames of 5 megapixels, Mono12p, 30 a second, over loopback.");
  double seconds = 10.0, lost_percent = 0.0, fps = 30.0;
  int packet_bytes = 7500;
  app.add_option("--seconds", seconds)->capture_default_str();
  app.add_option("--lost", lost_percent, "% of the packets")->capture_default_str();
  app.add_option("--fps", fps)->capture_default_str();
  app.add_option("--packet-size", packet_bytes)->capture_default_str();
  app.footer("Example:\n  build/release/tests/gige_bench --lost 0.1");
  CLI11_PARSE(app, argc, argv);
  start_logging("gige_bench", LogOptions());
  const std::shared_ptr<const Image16> picture = random_picture();
  WireCamera stand_in({.serial = "bench", .sensor = kSize, .lost = lost_percent / 100.0, .chunks = false},
                      [&](const WireCamera::Exposure&) { return picture; });
  AravisCamera::Options options;
  options.device = "bench";
  options.format = "Mono12p";
  options.frame_rate_hz = fps;
  options.packet_bytes = packet_bytes;
  absl::StatusOr<std::unique_ptr<AravisCamera>> camera = AravisCamera::open(options);
  if (!camera.ok() || !(*camera)->start(4.0).ok()) {
    std::cerr << camera.status() << "\n";
    return 1;
  }
  const std::int64_t exposed_before = stand_in.counts().exposed, lost_before = stand_in.counts().lost;
  const nanoseconds end = monotonic_now() + nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
  std::int64_t frames = 0, first = 0, last = 0;
  while (monotonic_now() < end) {
    const std::optional<CapturedFrame> frame = (*camera)->next(std::chrono::seconds(1));
    if (!frame) continue;
    ++frames;
    if (first == 0) first = frame->taken.sequence();
    last = frame->taken.sequence();
  }
  (*camera)->stop();
  const WireCamera::Counts did = stand_in.counts();
  const v1::GetCameraResponse told = (*camera)->describe();
  rusage used{};
  ::getrusage(RUSAGE_SELF, &used);
  const auto exposed = static_cast<double>(did.exposed - exposed_before);
  std::cerr << fmt::format(
      "{} frames of {:.0f} exposed arrived in {} s; {} named as dropped, {} missing in the sequence, {} "
      "packets "
      "missing; the camera lost {} packets, sent {} again and skipped {} frames; both "
      "used {} MB\n",
      frames, exposed, seconds, told.dropped_frames(), last - first + 1 - frames, told.missing_packets(),
      did.lost - lost_before, did.resent, did.overrun, used.ru_maxrss / 1000);
  std::cout << fmt::format(
      "{{\"name\": \"GigE, 5 MP Mono12p at {:g} fps, {:g} % lost: whole frames\", "
      "\"value\": {:.4f}, \"unit\": \"of those exposed\"}}\n",
      fps, lost_percent, static_cast<double>(frames) / exposed);
  return 0;
}
