// The simulator's own picture from the monitor: its crystal, lit from the camera's place.
//
//   simulated-from-monitor MONITOR_WIDTH MONITOR_HEIGHT CAMERA_WIDTH CAMERA_HEIGHT FOCAL_PX TURN_DEG
//   OUTPUT.exr
//
// Each camera pixel sends kRays x kRays rays of light 1 through the scene, which the monitor's pixels
// collect. White is a monitor's pixel that gets as much as an average one would if nothing stood between.
#include <cstdlib>
#include <iostream>

#include "core/image/image_file.h"
#include "core/sim/transport.h"

namespace glasswing {
namespace {

constexpr int kRays = 12;  // across a camera pixel

absl::Status write(char** words) {
  const auto number = [words](int i) { return std::atoi(words[i]); };
  const int width = number(0), height = number(1), camera_width = number(2), camera_height = number(3);
  const absl::StatusOr<Transport> transport = build_transport(
      "crystal", true, {{.name = "back", .size = {width, height}}}, camera_width, camera_height, kRays,
      std::atof(words[4]) / camera_width, {.turn_deg = std::atof(words[5])}, true);
  if (!transport.ok()) return transport.status();
  const float scale = static_cast<float>(width * height) / static_cast<float>(camera_width * camera_height);
  RadianceImage picture(width, height);
  for (int y = 0; y < camera_height; ++y) {
    for (int x = 0; x < camera_width; ++x) {
      for (int c = 0; c < 3; ++c) {
        for (const Tap& tap : transport->taps(x, y, c))
          picture.at(tap.x_px, tap.y_px, c) += scale * tap.weight;
      }
    }
  }
  return write_radiance(words[6], picture, Encoding::kLinear);
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  const absl::Status written =
      argc == 8 ? glasswing::write(argv + 1) : absl::InvalidArgumentError("seven words are needed");
  if (!written.ok()) std::cerr << written.message() << "\n";
  return written.ok() ? EXIT_SUCCESS : EXIT_FAILURE;
}
