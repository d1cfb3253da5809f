// The empty stage on the ramp, measured for RampExtractor.
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

// The background of a camera pixel.
enum class Behind : std::uint8_t {
  kRamp,
  kBeyond,  // no part of the monitor
  kPatch,   // the id patch, which changes in every frame
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
  std::vector<float> black;         // subtracted from each frame; empty: nothing
  MonitorMap map;
  ColourManifold manifold;
  std::vector<Behind> behind;
  std::vector<float> x_px, y_px;  // the position straight behind, monitor px
  // The noise of a frame's sample, from the manifest or several empty frames. Otherwise from the roughness of
  // the single empty frame, and a frame's own may be larger.
  SampleNoise noise;
  bool noise_known = false;
  double empty_share = 0.0;  // the average's variance as a share of that
  std::vector<std::string> warnings;
};

// Standard deviation of a picture's noise, in light, from second differences along its rows, which are close
// to 0 for the ramp and for most objects in front of it.
double roughness(const FrameView& view);

}  // namespace glasswing
