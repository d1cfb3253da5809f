// What each pixel of the simulated camera sees of monitor "back", gray.
//
//   scene-taps SCENE MONITOR_WIDTH MONITOR_HEIGHT CAMERA_WIDTH CAMERA_HEIGHT OUTPUT
//
// For each pixel, row by row, a number n of int32, n indices of the monitor's pixels of int32, and n weights
// of float.
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "core/sim/transport.h"

namespace glasswing {
namespace {

absl::Status write(char** words) {
  const auto number = [words](int i) { return std::atoi(words[i]); };
  const int width = number(1), height = number(2), camera_width = number(3), camera_height = number(4);
  const absl::StatusOr<Transport> transport = build_transport(
      words[0], true, {{.name = "back", .size = {width, height}}}, camera_width, camera_height);
  if (!transport.ok()) return transport.status();
  std::ofstream out(words[5], std::ios::binary);
  const auto put = [&out](const auto& value) {
    out.write(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (int i = 0; i < camera_width * camera_height; ++i) {
    const std::vector<Tap> taps = transport->taps(i % camera_width, i / camera_width, 0);
    put(static_cast<std::int32_t>(taps.size()));
    for (const Tap& tap : taps) put(tap.y_px * width + tap.x_px);
    for (const Tap& tap : taps) put(tap.weight);
  }
  return out.good() ? absl::OkStatus() : absl::UnavailableError("the taps cannot be written");
}

}  // namespace
}  // namespace glasswing

int main(int argc, char** argv) {
  const absl::Status written =
      argc == 7 ? glasswing::write(argv + 1) : absl::InvalidArgumentError("six words are needed");
  if (!written.ok()) std::cerr << written.message() << "\n";
  return written.ok() ? EXIT_SUCCESS : EXIT_FAILURE;
}
