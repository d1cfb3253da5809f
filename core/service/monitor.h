// A monitor as its display node describes it, and as an archive lists it.
#pragma once

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/display_service.pb.h"

namespace glasswing {

inline v1::Monitor listed_monitor(const v1::DisplayMonitor& shown) {
  v1::Monitor monitor;
  monitor.set_name(shown.name());
  monitor.set_width_px(shown.width_px());
  monitor.set_height_px(shown.height_px());
  monitor.set_patch_rows(shown.patch_rows());
  monitor.set_refresh_hz(shown.refresh_hz());
  monitor.set_response(shown.response());
  monitor.set_bits(shown.bits());
  if (shown.rail().has_position_mm()) monitor.set_rail_mm(shown.rail().position_mm());
  return monitor;
}

}  // namespace glasswing
