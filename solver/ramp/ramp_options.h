// What method "ramp" can be told.
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
  // ... if it also differs by this share of full scale: light drifts.
  double min_difference = 0.002;
  // Half sides of the squares that dilate and erode, px. Left out: 0.3 % of the picture's diagonal; as
  // dilated.
  std::optional<int> dilation_px = std::nullopt, erosion_px = std::nullopt;
  bool fill_holes = true;
  // How wide the object's edge is, px: so far from the rim pixels may show a part of what lies straight
  // behind. 0: alpha is 0 or 1.
  int edge_px = 1;

  // --- Highlights (section 4.3) ---
  bool highlights = true;  // false: the object was lit by the ramp alone, F = 0
  double delta = 0.05;     // rho > 1 + delta is a highlight
  // Round such pixels, what is brighter by this share of the ramp than the object further off belongs to the
  // highlight.
  double highlight_rise = 0.02;
  // Half the width of the widest highlight, px. Left out: 4 % of the picture's diagonal.
  std::optional<int> highlight_reach_px = std::nullopt;
  double highlight_blur_px = 1.0;  // sigma that smoothes what is interpolated across a highlight
  double highlight_gain = 1.0;     // what f is multiplied by
  // Least f where all channels are clipped: how much brighter it was nobody knows.
  double clipped_highlight = 1.0;

  SmoothingOptions smoothing;
};

// Name, range and default of every option, for people.
std::string ramp_options_help();

// INVALID_ARGUMENT: an option that ramp has not, or a value out of range.
absl::StatusOr<RampOptions> parse_ramp_options(const MethodOptions& options);

}  // namespace glasswing
