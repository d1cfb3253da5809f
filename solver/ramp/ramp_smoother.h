// Smoothing of a noisy video matte: c and rho of one frame from those of its neighbourhood in space and time.
#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "solver/ramp/ramp_frame.h"
#include "solver/video_method.h"

namespace glasswing {

enum class Smoothing { kNone, kPeronaMalik, kAdaptive };

struct SmoothingOptions {
  Smoothing smoothing = Smoothing::kAdaptive;
  int reach = 1;        // frames before and after that take part, 0 to 4
  bool causal = false;  // frames after take no part, as live
  // Of Perona-Malik alone.
  int iterations = 10;       // 1 to 100
  double contrast_px = 4.0;  // K, monitor px: steps well above it are edges; (0, 1000]
  bool exponential = true;   // g = exp(-(d/K)^2); else 1 / (1 + (d/K)^2)
};

// Takes a method's option if it is one of these: smoothing (adaptive, perona-malik, none), smoothing_reach,
// and with perona-malik smoothing_iterations, smoothing_contrast and smoothing_conductance (exponential,
// rational). False: it is not. INVALID_ARGUMENT: a value out of range.
absl::StatusOr<bool> parse_smoothing_option(const std::string& key, const std::string& value,
                                            SmoothingOptions& options);

struct SmoothPilot;

// A frame as extracted, before finishing, and its samples. Both must last as long as they are used.
struct SmoothInput {
  const RampFrame* frame = nullptr;
  FrameView view;
  std::shared_ptr<const SmoothPilot> pilot = nullptr;  // by prepare(); may be left out
};

// Thread-safe. Results depend on the frames in reach alone, and not on the count of threads.
class RampSmoother {
 public:
  // noise_sd: of the samples, radiance; >= 0.
  RampSmoother(const SmoothingOptions& options, double noise_sd) : options_(options), noise_sd_(noise_sd) {}

  // How many frames on each side smooth() makes use of.
  int frames_before() const;
  int frames_after() const;

  // Works out once what every frame in reach needs of this one; smooth() does it itself where it is missing.
  void prepare(SmoothInput& input, int thread_count) const;

  // window[at], smoothed; the others are the frames before and after it, by time, all of one size. At the ends
  // of a video there are fewer. Pixels of alpha 0 stay as they are.
  RampFrame smooth(std::span<const SmoothInput> window, size_t at, int thread_count) const;

 private:
  SmoothingOptions options_;
  double noise_sd_;
};

}  // namespace glasswing
