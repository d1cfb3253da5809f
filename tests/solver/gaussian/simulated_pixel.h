// One pixel's channel in front of a monitor of 128 x 96 px, swept in four directions: its samples, the
// solver's result, and the Cramer-Rao bound.
#pragma once

#include <random>
#include <vector>

#include "solver/gaussian/kernels/joint_batch.h"
#include "solver/gaussian/mode_search.h"

namespace glasswing {

inline constexpr MonitorExtent kSimulatedExtent{.width_px = 128.0, .height_px = 96.0};

// 0, 90, 45 and -45 degrees, stripes half their own sigma apart.
SampleLayout four_sweeps(double sigma_px);

// The closed form at sample i of a sweep.
double answer(const Footprints& modes, const SampleLayout& layout, const SampleLayout::Sweep& sweep, int i);

PixelSamples recorded(const Footprints& modes, const SampleLayout& layout, double noise_sd,
                      std::mt19937& random);

// Solves a pixel: peaks, then the search.
JointFit solved(const PixelSamples& samples, double noise_sd, int max_modes = kMaxFootprints);

// The Cramer-Rao bound of (R, x, y, xx, xy, yy) of each mode, for noise of standard deviation 1.
std::vector<double> cramer_rao_bound(const Footprints& truth, const SampleLayout& layout);

// For fit_batch, with stride 1.
BatchPixel batch_pixel(const PixelSamples& samples, const Footprints& start);

double& parameter(Footprint& mode, int p);

}  // namespace glasswing
