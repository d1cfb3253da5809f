// Where a camera sees a monitor, and what it sees there, in the frames of a display calibration
// (core/pattern/calibration_steps).
//
// A pixel sees the monitor if white there is brighter than black by more than half of what the brightest
// thousandth is, in all channels, if the ramp is there too (an id patch beside the picture shows none), and
// if this holds for its eight neighbours. Where white is cut off it does not count.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/import/mapped_archive.h"
#include "core/radiometry/display_response.h"
#include "core/radiometry/frame_light.h"

namespace glasswing {

inline constexpr double kMaxLight = 0.95;  // of the camera's full scale: beyond, noise is cut off

// A frame of the archive in which the monitor shows codes.
struct ShownFrame {
  int frame = 0;              // its place in the manifest
  std::array<int, 3> code{};  // of a solid
  double exposure_ms = 0.0;
  nanoseconds at{};
};
struct ShownFrames {
  std::vector<ShownFrame> solids, ramps;
};
ShownFrames shown_frames(const v1::CaptureManifest& manifest, const v1::Monitor& monitor);

// 8 where the monitor does not say.
inline int bits_of(const v1::Monitor& monitor) {
  return monitor.bits() > 0 ? monitor.bits() : 8;
}

struct ScreenView {
  using Light = std::array<float, 3>;

  double exposure_ms = 0.0;           // the longest at which white is not cut off
  int width_px = 0;                   // the camera's
  std::vector<std::uint32_t> pixels;  // y * width + x, rising
  // Of each of them, at that exposure; white less black.
  std::vector<Light> white, ramp;
};

// FAILED_PRECONDITION says in plain words what is not shown, or that white is too dark, cut off at all
// exposures, or seen by fewer than 300 pixels.
absl::StatusOr<ScreenView> find_screen(const MappedArchive& archive, const FrameLight& light,
                                       const ShownFrames& shown, int bits);

// Means over the pixels; standard errors from what neighbours differ by, so that they hold noise and what
// structure the picture has, but nothing that is common to a frame.
struct SeenSolid {
  ShownSolid solid;
  double exposure_ms = 0.0;
  bool cut_off = false;  // more than one pixel in 10000, or the mean above kMaxLight
};
SeenSolid see(const MappedArchive& archive, const FrameLight& light, const std::vector<std::uint32_t>& pixels,
              const ShownFrame& shown);

}  // namespace glasswing
