#include "solver/ramp/ramp_options.h"

#include "core/base/status.h"
#include "core/method/methods.h"

namespace glasswing {
namespace {

SmoothingOptions smoothing_of(const OptionValues& values) {
  const std::string& smoothing = values.text("smoothing");
  return {.smoothing = smoothing == "none"           ? Smoothing::kNone
                       : smoothing == "perona-malik" ? Smoothing::kPeronaMalik
                                                     : Smoothing::kAdaptive,
          .reach = values.whole("smoothing_reach"),
          .iterations = values.whole("smoothing_iterations"),
          .contrast_px = values.number("smoothing_contrast"),
          .exponential = values.text("smoothing_conductance") == "exponential"};
}

// Empty: the default, which depends on the picture's size.
std::optional<int> length_of(const OptionValues& values, std::string_view option) {
  return values.has(option) ? std::optional(values.whole(option)) : std::nullopt;
}

}  // namespace

absl::StatusOr<RampOptions> parse_ramp_options(const MethodOptions& options) {
  GW_ASSIGN_OR_RETURN(const OptionValues values, OptionValues::read("ramp", options));
  return RampOptions{.threshold_sd = values.number("threshold_sd"),
                     .min_difference = values.number("least_difference"),
                     .dilation_px = length_of(values, "dilation_px"),
                     .erosion_px = length_of(values, "erosion_px"),
                     .fill_holes = values.is_set("fill_holes"),
                     .edge_px = values.whole("edge_px"),
                     .highlights = values.is_set("highlights"),
                     .delta = values.number("delta"),
                     .highlight_rise = values.number("highlight_rise"),
                     .highlight_reach_px = length_of(values, "highlight_reach_px"),
                     .highlight_blur_px = values.number("highlight_blur_px"),
                     .highlight_gain = values.number("highlight_gain"),
                     .clipped_highlight = values.number("clipped_highlight"),
                     .smoothing = smoothing_of(values)};
}

}  // namespace glasswing
