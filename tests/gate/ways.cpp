#include "tests/gate/ways.h"

namespace glasswing::gate {

const std::map<std::string, Way>& ways() {
  static const std::map<std::string, Way> all = [] {
    const std::string
        solids = "solids { colour: [0, 0, 0] } solids { colour: [1, 1, 1] } ",
        bars = solids + "square_waves { levels: 6 } ",
        sweeps =
            "sweeps { orientation_deg: 0 sigma_px: 3 } sweeps { orientation_deg: 90 sigma_px: 3 } "
            "sweeps { orientation_deg: 45 sigma_px: 3 } sweeps { orientation_deg: -45 sigma_px: 3 }",
        waves =
            "fringes { orientation_deg: 0 period_px: [72, 32, 14, 7] } "
            "fringes { orientation_deg: 90 period_px: [72, 32, 14, 7] } "
            "fringes { orientation_deg: 45 period_px: [24, 10] } "
            "fringes { orientation_deg: -45 period_px: [24, 10] }";
    return std::map<std::string, Way>{
        {"gaussian", {"gaussian", {}, "method: 'gaussian' " + bars + sweeps}},
        {"few", {"gaussian", {{"images", "80"}}, "method: 'gaussian' " + bars + sweeps}},
        {"hierarchical", {"hierarchical", {}, "method: 'hierarchical' " + bars}},
        {"fringe", {"fringe", {{"modes", "2"}}, "method: 'fringe' " + solids + waves}},
        {"alpha", {"alpha", {}, "method: 'alpha' " + solids}},
        {"ramp", {"ramp", {}, "method: 'ramp' ramp { empty_frames: 4 frames: 3 }"}}};
  }();
  return all;
}

}  // namespace glasswing::gate
