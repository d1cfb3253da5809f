// The smooth maps of a session's monitors (stage_map.h), from everything that saw the empty stage: the bars
// that BackgroundMap decodes, and swept stripes, including those with the object where it changes nothing,
//
//   y(r) = b + a exp(-(r - t)^2 / (2 s^2))
//
// whose t is where a pixel looks along the sweep. Every solver reads the same rows and columns, so tiles join
// without seams.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "solver/background/empty_stage.h"

namespace glasswing {

inline constexpr double kUsualNoise = 0.003;  // read noise of a camera that is not calibrated

struct StageMaps {
  // By texture. None: pixels keep the positions from their own bars.
  std::vector<std::optional<SmoothStage>> of_monitor;
  std::vector<std::string> warnings;  // for users: why a map is missing, or where it does not hold
};

// Reads a row of the picture from each of these frames, as light.
using LightReader = std::function<absl::StatusOr<FrameStack>(int row, const std::vector<int>& frames)>;

// Of these frames, which include all of lay_out_stage(). A session without square waves or stripes, or
// without an empty stage, has no maps, and no warning. Errors are those of Exposures::of and `read`.
absl::StatusOr<StageMaps> measure_stage_maps(const v1::CaptureManifest& manifest,
                                             const std::vector<int>& frames, const LightReader& read);

// The peak of a sweep's samples, by least squares.
struct SweepPeak {
  bool found = false;
  double centre_px = 0.0, centre_sd_px = 0.0;  // for samples of standard deviation 1
  double height = 0.0;
};
// `r_px` ascends; `sigma_px` is the stripe's.
SweepPeak find_sweep_peak(std::span<const double> r_px, std::span<const double> y, double sigma_px);

}  // namespace glasswing
