#include "tests/gate/ways.h"

#include <google/protobuf/text_format.h>

#include "core/design/plan_design.h"

namespace glasswing::gate {
namespace {

// As `glasswing plan design` makes it for the scenes' monitor.
std::string designed(int images) {
  v1::Monitor monitor;
  monitor.set_name("back");
  monitor.set_width_px(64);
  monitor.set_height_px(48);
  const DesignWish wish{.images = images, .noise = {.read_sd = 0.005, .full_well = {}}};
  std::string text;
  google::protobuf::TextFormat::PrintToString(
      design_plan(wish, {.monitors = {monitor}, .camera = {}}).value().plan, &text);
  return text;
}

}  // namespace

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
        {"designed", {"gaussian", {}, designed(62)}},
        {"fringe", {"fringe", {{"modes", "2"}}, "method: 'fringe' " + solids + waves}},
        {"alpha", {"alpha", {}, "method: 'alpha' " + solids}},
        {"ramp", {"ramp", {}, "method: 'ramp' ramp { empty_frames: 4 frames: 3 }"}}};
  }();
  return all;
}

}  // namespace glasswing::gate
