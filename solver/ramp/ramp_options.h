// The options of method "ramp".
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>

#include "solver/method/method.h"
#include "solver/ramp/smoother/ramp_smoother.h"

namespace glasswing {

struct RampOptions {
  // --- The object (Chuang et al. 2000, section 4.2) ---
  // A colour that differs from the empty stage's by more than this many standard deviations of the noise
  // shows the object ...
  double threshold_sd = 5.5;
  // ... if it also differs by this share of full scale, which allows for drift of the light.
  double min_difference = 0.002;
  // Half sides of the squares for dilation and erosion, px. Default: 0.3 % of the picture's diagonal; as
  // dilation.
  std::optional<int> dilation_px = std::nullopt, erosion_px = std::nullopt;
  bool fill_holes = true;
  // The width of the object's edge, px: this far from the rim pixels may show part of the background. 0:
  // alpha is 0 or 1.
  int edge_px = 1;

  // --- Highlights (section 4.3) ---
  bool highlights = true;  // false: the ramp is the only light, F = 0
  double delta = 0.05;     // rho > 1 + delta is a highlight
  // Around such pixels, the highlight includes what exceeds the object further off by this share of the ramp.
  double highlight_rise = 0.02;
  // Half the width of the widest highlight, px. Default: 4 % of the picture's diagonal.
  std::optional<int> highlight_reach_px = std::nullopt;
  double highlight_blur_px = 1.0;  // sigma that smooths the interpolation across a highlight
  double highlight_gain = 1.0;     // factor applied to f
  // Minimum f where all channels are clipped: the true value is unknown.
  double clipped_highlight = 1.0;

  SmoothingOptions smoothing;
};

// INVALID_ARGUMENT: an unknown option, or a value out of range.
absl::StatusOr<RampOptions> parse_ramp_options(const MethodOptions& options);

}  // namespace glasswing
