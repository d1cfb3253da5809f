// A simulated sensor behind a lens: integrates a scene's light over each row's own exposure (rolling
// shutter), adds noise and quantises.
//
//   value = exposure / full_scale_exposure * shading * mean radiance;   variance = read_sd^2 + gain * value
//   sample = curve(black_level + (1 - black_level) * (value + noise)), clipped at full scale
#pragma once

#include <cstdint>
#include <span>

#include "core/base/time.h"
#include "core/image/image.h"
#include "core/sim/emission_timeline.h"
#include "core/sim/sample_kernel.h"
#include "core/sim/transport.h"

namespace glasswing {

struct SensorModel {
  double read_sd = 0.001;                              // of full scale
  double gain = 1e-5;                                  // shot noise: variance per value
  double vignetting = 0.0;                             // share of light missing in corners (radial_shading.h)
  double black_level = 0.0;                            // reading without light, of full scale
  SensorCurve curve = {};                              // linear
  int bits = 12;                                       // 8 to 16; samples are stored on the 16-bit scale
  nanoseconds readout = std::chrono::milliseconds(2);  // first row's start to last row's start
  double full_scale_exposure_ms = 4.5;                 // at which radiance 1.0 reads 1.0
  std::uint64_t seed = 1;
};

struct ExposureWindow {
  nanoseconds start{};     // of the first row, physical time
  nanoseconds exposure{};  // of each row
};

// Mean radiance over each row's exposure. Exact in time: if a picture changes on a monitor row during a
// camera row's exposure, both pictures contribute by their share of time, and flicker is integrated too.
// `emission` covers the window, in the order of the monitors that `transport` was built with. Camera rows
// that see a change cost a few times as much as others.
RadianceImage integrate(const Transport& transport, std::span<const MonitorEmission> emission,
                        const ExposureWindow& window, nanoseconds readout);

// Applies a lens whose blur is a Gaussian of `sigma_px` sensor pixels to a picture with kRaysAcross x
// kRaysAcross samples per pixel. The light is blurred before it is averaged over pixels.
RadianceImage through_lens(const RadianceImage& rays, double sigma_px);

// The sensor's response to that light; equal (model.seed, frame_number) give equal noise.
Image16 expose(const RadianceImage& mean_radiance, double exposure_ms, const SensorModel& model,
               std::int64_t frame_number);

}  // namespace glasswing
