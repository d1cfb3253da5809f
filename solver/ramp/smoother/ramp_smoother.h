// Smooths a noisy video matte: c and rho of one frame from their neighbourhood in space and time.
//
// adaptive: fits planes in c and rho to a window around each pixel that grows over its piece of the object
// and stops at the edges (ramp_smoother_kernel.h). Before that, frames near in time are averaged along the
// object's motion where they agree within the noise (ramp_smoother_motion.h). Large pictures are smoothed at
// half resolution and then refined (ramp_smoother_refine.h). There is nothing to tune: it uses only the noise
// that the frame states.
//
// perona-malik: anisotropic diffusion of c in space and time (ramp_smoother_diffusion.h), as in Chuang et
// al. 2000, section 4.2.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

enum class Smoothing { kNone, kPeronaMalik, kAdaptive };

struct SmoothingOptions {
  Smoothing smoothing = Smoothing::kAdaptive;
  int reach = 1;        // number of frames used before and after, 0 to 4
  bool causal = false;  // uses no frames after, for live use
  // Perona-Malik only.
  int iterations = 10;       // 1 to 1000
  double contrast_px = 4.0;  // K, monitor px: steps well above it are edges; (0, 10000]
  bool exponential = true;   // g = exp(-(d/K)^2); else 1 / (1 + (d/K)^2)
};

struct SmoothPilot;

// A frame as extracted, before finishing. The frame must outlive this.
struct SmoothInput {
  const RampFrame* frame = nullptr;
  std::shared_ptr<const SmoothPilot> pilot = nullptr;  // by prepare(); optional
};

// Thread-safe. Results depend only on the frames in reach, not on the thread count (0: all cores).
class RampSmoother {
 public:
  explicit RampSmoother(const SmoothingOptions& options) : options_(options) {}

  // How many frames on each side smooth() uses.
  int frames_before() const { return options_.smoothing == Smoothing::kNone ? 0 : options_.reach; }
  int frames_after() const { return options_.causal ? 0 : frames_before(); }

  // Computes once what every frame in reach needs of this one; without it smooth() computes it each time.
  void prepare(SmoothInput& input, int thread_count) const;

  // Returns window[at] smoothed; the others are frames before and after it, by time, all of one size. Some
  // may be missing. Pixels of alpha 0 are unchanged, and so are highlights, which are already bridged.
  // Elsewhere without information rho is unchanged, and c comes from neighbours within 4 px, if any.
  RampFrame smooth(std::span<const SmoothInput> window, size_t at, int thread_count) const;

 private:
  RampFrame adapt(std::span<const SmoothInput> window, size_t at, int thread_count) const;

  SmoothingOptions options_;
};

}  // namespace glasswing
