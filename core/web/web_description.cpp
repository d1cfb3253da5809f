#include "core/web/web_description.h"

#include <vector>

namespace glasswing {

nlohmann::ordered_json describe_web_matte(const std::string& title, const v1::MatteMetadata& metadata,
                                          int sampling_px, const WebMatte& web) {
  nlohmann::ordered_json monitors = nlohmann::json::array(), crosstalk = nlohmann::json::array(),
                         planes = nlohmann::json::array();
  for (const v1::Monitor& monitor : metadata.monitors())
    monitors.push_back(
        {{"name", monitor.name()}, {"width_px", monitor.width_px()}, {"height_px", monitor.height_px()}});
  for (const v1::Crosstalk& each : metadata.crosstalk())
    crosstalk.push_back({{"share", std::vector<double>(each.share().begin(), each.share().end())}});
  for (const WebPlane& plane : web.planes) planes.push_back({{"name", plane.name}, {"bytes", plane.bytes}});
  return {{"format", "glasswing-web"},
          {"version", 1},
          {"title", title},
          {"x_px", web.region.x_px},
          {"y_px", web.region.y_px},
          {"width_px", web.region.width_px},
          {"height_px", web.region.height_px},
          {"metadata",
           {{"monitors", monitors},
            {"crosstalk", crosstalk},
            {"footprint", metadata.footprint()},
            {"sampling_px", sampling_px}}},
          {"unit_px", web.unit_px},
          {"origin_px", web.origin_px},
          {"foreground_scale", web.foreground_scale},
          {"footprints", web.footprint_count},
          {"planes", planes}};
}

}  // namespace glasswing
