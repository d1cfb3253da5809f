// Smoothing of a noisy video matte: c and rho of one frame from what is around in space and time.
//
// adaptive: each pixel's own window, fitted by planes in c and rho, which grows over the piece of the object
// that it belongs to and stops at its edges (ramp_smoother_kernel.h); before that, frames near in time are
// averaged along the object's motion where they agree within the noise (ramp_smoother_motion.h). Large
// pictures go through this at half resolution and are then refined (ramp_smoother_refine.h). Nothing is to be
// tuned: all it goes by is the noise that the frame states.
//
// perona-malik: anisotropic diffusion of c in space and time (ramp_smoother_diffusion.h), as in Chuang et
// al. 2000, section 4.2.
#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

enum class Smoothing { kNone, kPeronaMalik, kAdaptive };

struct SmoothingOptions {
  Smoothing smoothing = Smoothing::kAdaptive;
  int reach = 1;        // frames before and after that take part, 0 to 4
  bool causal = false;  // frames after take no part, as live
  // Of Perona-Malik alone.
  int iterations = 10;       // 1 to 1000
  double contrast_px = 4.0;  // K, monitor px: steps well above it are edges; (0, 10000]
  bool exponential = true;   // g = exp(-(d/K)^2); else 1 / (1 + (d/K)^2)
};

// Names, ranges and defaults of the options, for people.
std::string_view smoothing_options_help();

// Takes a method's option if it is one of these. False: it is not. INVALID_ARGUMENT: a value out of range.
absl::StatusOr<bool> parse_smoothing_option(const std::string& key, const std::string& value,
                                            SmoothingOptions& options);

struct SmoothPilot;

// A frame as extracted, before finishing. It must last as long as it is used.
struct SmoothInput {
  const RampFrame* frame = nullptr;
  std::shared_ptr<const SmoothPilot> pilot = nullptr;  // by prepare(); may be left out
};

// Thread-safe. Results depend on the frames in reach alone, and not on the count of threads (0: all cores).
class RampSmoother {
 public:
  explicit RampSmoother(const SmoothingOptions& options) : options_(options) {}

  // How many frames on each side smooth() makes use of.
  int frames_before() const { return options_.smoothing == Smoothing::kNone ? 0 : options_.reach; }
  int frames_after() const { return options_.causal ? 0 : frames_before(); }

  // Works out once what every frame in reach needs of this one; smooth() does it itself where it is missing.
  void prepare(SmoothInput& input, int thread_count) const;

  // window[at], smoothed; the others are frames before and after it, by time, all of one size. Some may be
  // missing. Pixels of alpha 0 stay as they are, and highlights, which are bridged already. Where else the
  // information is 0 rho stays, and c comes from neighbours, if there are any within 4 px.
  RampFrame smooth(std::span<const SmoothInput> window, size_t at, int thread_count) const;

 private:
  RampFrame adapt(std::span<const SmoothInput> window, size_t at, int thread_count) const;

  SmoothingOptions options_;
};

}  // namespace glasswing
