// The part of the camera's picture that shows a monitor, and its light, in the frames of a display
// calibration (core/pattern/calibration_steps).
//
// A pixel sees the monitor if white minus black exceeds half of that of the brightest thousandth of pixels,
// in all channels; if it also sees the ramp (an id patch beside the picture shows none); and if both hold for
// its eight neighbours. Pixels where white is clipped are excluded.
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

inline constexpr double kMaxLight = 0.95;  // of the camera's full scale: above it, noise is clipped

// A frame of the archive in which the monitor shows codes.
struct ShownFrame {
  int frame = 0;              // index in the manifest
  std::array<int, 3> code{};  // of a solid
  double exposure_ms = 0.0;
  nanoseconds at{};
};
struct ShownFrames {
  std::vector<ShownFrame> solids, ramps;
};
ShownFrames shown_frames(const v1::CaptureManifest& manifest, const v1::Monitor& monitor);

// 8 if unknown.
inline int bits_of(const v1::Monitor& monitor) {
  return monitor.bits() > 0 ? monitor.bits() : 8;
}

struct ScreenView {
  using Light = std::array<float, 3>;

  double exposure_ms = 0.0;           // the longest at which white is not clipped
  int width_px = 0;                   // the camera's
  std::vector<std::uint32_t> pixels;  // y * width + x, rising
  // By pixel, at that exposure, minus black.
  std::vector<Light> white, ramp;
};

// FAILED_PRECONDITION: a picture is missing, or white is too dark, clipped at all exposures, or seen by fewer
// than 300 pixels.
absl::StatusOr<ScreenView> find_screen(const MappedArchive& archive, const FrameLight& light,
                                       const ShownFrames& shown, int bits);

// Means over the pixels. Standard errors come from differences of neighbours, so they include noise and the
// picture's structure, but no error common to a whole frame.
struct SeenSolid {
  ShownSolid solid;
  double exposure_ms = 0.0;
  bool cut_off = false;  // more than one pixel in 10000, or the mean above kMaxLight
};
SeenSolid see(const MappedArchive& archive, const FrameLight& light, const std::vector<std::uint32_t>& pixels,
              const ShownFrame& shown);

}  // namespace glasswing
