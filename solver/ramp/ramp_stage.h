// The empty stage before the ramp, as RampExtractor needs it.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "solver/background/silhouette.h"
#include "solver/method/sample_noise.h"
#include "solver/method/video_method.h"
#include "solver/ramp/colour_manifold.h"
#include "solver/ramp/monitor_map.h"
#include "solver/ramp/ramp_options.h"
#include "solver/ramp/video_layout.h"

namespace glasswing {

// What a camera pixel sees past the object.
enum class Behind : std::uint8_t {
  kRamp,
  kBeyond,  // no part of the monitor
  kPatch,   // the id patch, another one in every frame
};

struct RampStage {
  // Errors: those of RampExtractor::create.
  static absl::StatusOr<RampStage> measure(const v1::CaptureManifest& manifest, const VideoLayout& layout,
                                           std::span<const FrameView> empties,
                                           std::span<const FrameView> black);

  v1::Monitor monitor;
  int texture = 0;
  int width_px = 0, height_px = 0;  // of the camera
  std::vector<float> average;       // r, g, b by rows, light of the ramp alone
  std::vector<float> black;         // likewise, taken off each frame; empty: nothing
  MonitorMap map;
  ColourManifold manifold;
  std::vector<Behind> behind;
  std::vector<float> x_px, y_px;  // the place straight behind, monitor px
  // Of a sample of a frame. Known from the manifest or from several empty frames; else it is what the one
  // empty frame's roughness tells, and a frame's own may be more.
  SampleNoise noise;
  bool noise_known = false;
  double empty_share = 0.0;  // of that variance, in the average
  std::vector<std::string> warnings;
};

// Standard deviation of a picture's noise, light, from second differences along its rows: the ramp, and most
// of what an object makes of it, has next to none.
double roughness(const FrameView& view);

}  // namespace glasswing
