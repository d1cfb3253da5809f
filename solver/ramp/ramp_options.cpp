#include "solver/ramp/ramp_options.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>

#include "core/base/status.h"
#include "core/pattern/method_options.h"

namespace glasswing {
namespace {

struct Option {
  const char* name;
  double low, high;
  bool whole;
  std::function<void(RampOptions&, double)> set;
};

const std::vector<Option>& table() {
  static const std::vector<Option> options = {
      {"threshold_sd", 1.0, 1000.0, false, [](RampOptions& o, double v) { o.threshold_sd = v; }},
      {"least_difference", 0.0, 1.0, false, [](RampOptions& o, double v) { o.min_difference = v; }},
      {"dilation_px", 0.0, 1000.0, true,
       [](RampOptions& o, double v) { o.dilation_px = static_cast<int>(v); }},
      {"erosion_px", 0.0, 1000.0, true, [](RampOptions& o, double v) { o.erosion_px = static_cast<int>(v); }},
      {"fill_holes", 0.0, 1.0, true, [](RampOptions& o, double v) { o.fill_holes = v != 0.0; }},
      {"edge_px", 0.0, 20.0, true, [](RampOptions& o, double v) { o.edge_px = static_cast<int>(v); }},
      {"highlights", 0.0, 1.0, true, [](RampOptions& o, double v) { o.highlights = v != 0.0; }},
      {"delta", 0.0, 1.0, false, [](RampOptions& o, double v) { o.delta = v; }},
      {"highlight_rise", 0.001, 1.0, false, [](RampOptions& o, double v) { o.highlight_rise = v; }},
      {"highlight_reach_px", 1.0, 1000.0, true,
       [](RampOptions& o, double v) { o.highlight_reach_px = static_cast<int>(v); }},
      {"highlight_blur_px", 0.0, 100.0, false, [](RampOptions& o, double v) { o.highlight_blur_px = v; }},
      {"highlight_gain", 0.0, 100.0, false, [](RampOptions& o, double v) { o.highlight_gain = v; }},
      {"clipped_highlight", 0.0, 100.0, false, [](RampOptions& o, double v) { o.clipped_highlight = v; }},
  };
  return options;
}

}  // namespace

std::string ramp_options_help() {
  return std::string(
             "threshold_sd       1 to 1000, default 5.5: a pixel shows the object if its colour differs from "
             "the "
             "empty stage's by so many standard deviations of the noise\n"
             "least_difference   0 to 1, default 0.002: ... and by this share of full scale\n"
             "dilation_px        0 to 1000, default 0.3 % of the picture's diagonal: closes gaps in the "
             "object\n"
             "erosion_px         0 to 1000, default dilation_px\n"
             "fill_holes         0 or 1, default 1\n"
             "edge_px            0 to 20, default 1: width of the object's edge, where alpha may be "
             "between 0 and 1\n"
             "highlights         0 or 1, default 1: 0 if the ramp is the only light\n"
             "delta              0 to 1, default 0.05: a pixel brighter than the ramp by this share is a "
             "highlight; the paper used 0.03 to 0.10\n"
             "highlight_rise     0.001 to 1, default 0.02: ... with the pixels around it that exceed the "
             "object "
             "further off by this share\n"
             "highlight_reach_px 1 to 1000, default 4 % of the picture's diagonal: half the width of the "
             "widest "
             "highlight\n"
             "highlight_blur_px  0 to 100, default 1: sigma that smooths the interpolation across a "
             "highlight\n"
             "highlight_gain     0 to 100, default 1: factor applied to highlights\n"
             "clipped_highlight  0 to 100, default 1: minimum of a highlight that clips all channels; "
             "0: as measured\n") +
         std::string(smoothing_options_help());
}

absl::StatusOr<RampOptions> parse_ramp_options(const MethodOptions& options) {
  RampOptions parsed;
  for (const auto& [key, value] : options) {
    GW_ASSIGN_OR_RETURN(const bool smooths, parse_smoothing_option(key, value, parsed.smoothing));
    if (smooths) continue;
    const auto known =
        std::ranges::find(table(), key, [](const Option& option) { return std::string(option.name); });
    if (known == table().end()) return unknown_option("ramp", key);
    GW_ASSIGN_OR_RETURN(const double number, number_option(key, value, known->low, known->high));
    if (known->whole && number != std::floor(number))
      return absl::InvalidArgumentError(fmt::format("{} is \"{}\"; it must be a whole number", key, value));
    known->set(parsed, number);
  }
  return parsed;
}

}  // namespace glasswing
