#include "tests/solver/gaussian/simulated_pixel.h"

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numbers>

namespace glasswing {

SampleLayout four_sweeps(double sigma_px) {
  SampleLayout layout;
  for (const double degrees : {0.0, 90.0, 45.0, -45.0}) {
    const double phi = degrees * std::numbers::pi / 180.0;
    const StripeAxis axis{.cos_phi = std::cos(phi), .sin_phi = std::sin(phi), .sigma_px = sigma_px};
    double low = 0.0, high = 0.0;
    for (const double x : {0.0, kSimulatedExtent.width_px}) {
      for (const double y : {0.0, kSimulatedExtent.height_px}) {
        low = std::min(low, x * axis.cos_phi + y * axis.sin_phi);
        high = std::max(high, x * axis.cos_phi + y * axis.sin_phi);
      }
    }
    std::vector<double> r_px;
    for (double r = low - 2.0 * sigma_px; r <= high + 2.0 * sigma_px; r += 0.5 * sigma_px) r_px.push_back(r);
    layout.add(axis, r_px);
  }
  return layout;
}

double answer(const Footprints& modes, const SampleLayout& layout, const SampleLayout::Sweep& sweep, int i) {
  const double r = sweep.first_r_px + static_cast<double>(layout.offset_px[sweep.first + i]);
  double sum = 0.0;
  for (const Footprint& mode : modes) sum += response(mode, sweep.axis, r, kSimulatedExtent);
  return sum;
}

PixelSamples recorded(const Footprints& modes, const SampleLayout& layout, double noise_sd,
                      std::mt19937& random) {
  PixelSamples samples{.layout = &layout, .y = {}, .weight = {}};
  samples.y.resize(layout.padded_count());
  samples.weight.resize(samples.y.size());
  std::normal_distribution<double> normal;  // a width of 0 would be undefined
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (int i = 0; i < sweep.count; ++i) {
      const size_t place = sweep.first + i;
      samples.y[place] = static_cast<float>(answer(modes, layout, sweep, i) +
                                            (noise_sd > 0.0 ? noise_sd * normal(random) : 0.0));
      samples.weight[place] = 1.0f;
    }
  }
  return samples;
}

JointFit solved(const PixelSamples& samples, double noise_sd, int max_modes) {
  const SampleLayout& layout = *samples.layout;
  // Uses the peak finder with this pixel in the first lane.
  std::vector<std::vector<float>> lanes;
  std::vector<SweepBlock> blocks;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    std::vector<float>& y = lanes.emplace_back(static_cast<size_t>(sweep.count) * kBlockLanes);
    for (int i = 0; i < sweep.count; ++i)
      y[static_cast<size_t>(i) * kBlockLanes] = samples.y[sweep.first + i];
    blocks.push_back({.y = y.data(),
                      .count = sweep.count,
                      .first_r_px = sweep.first_r_px,
                      .step_px = 0.5 * sweep.axis.sigma_px});
  }
  std::array<float, kBlockLanes> floor, noise;
  floor.fill(std::max(3.5f * static_cast<float>(noise_sd), 0.0015f));
  noise.fill(static_cast<float>(noise_sd));
  std::vector<std::array<Peaks, kBlockLanes>> all;
  PeakFinder().find(blocks, floor, noise, 1u, all);
  std::vector<Peaks> peaks;
  for (const auto& sweep : all) peaks.push_back(sweep.front());
  JointWorkspace workspace;
  return find_footprints(samples, peaks, kSimulatedExtent, noise_sd, max_modes, workspace);
}

std::vector<double> cramer_rao_bound(const Footprints& truth, const SampleLayout& layout) {
  std::mt19937 random(1);
  const PixelSamples samples = recorded(truth, layout, 0.0, random);
  NormalEquations equations;
  JointWorkspace workspace;
  evaluate(samples, truth, kSimulatedExtent, workspace, equations);
  const Eigen::MatrixXd covariance = equations.matrix.inverse();
  std::vector<double> sd;
  for (const double variance : covariance.diagonal()) sd.push_back(std::sqrt(variance));
  return sd;
}

BatchPixel batch_pixel(const PixelSamples& samples, const Footprints& start) {
  BatchPixel pixel;
  pixel.start = start;
  for (size_t s = 0; s < samples.layout->sweeps.size(); ++s) {
    const int first = samples.layout->sweeps[s].first;
    pixel.y[s] = samples.y.data() + first;
    pixel.weight[s] = samples.weight.data() + first;
  }
  return pixel;
}

double& parameter(Footprint& mode, int p) {
  return *std::array{&mode.weight, &mode.x_px, &mode.y_px, &mode.xx_px2, &mode.xy_px2, &mode.yy_px2}[p];
}

}  // namespace glasswing
