// Where a monitor stands, relative to its own place in the scene. About its centre it is first tilted, then
// turned, then moved. With the axes x right, y down and z = x cross y of a monitor at its own place, which
// leads away from the scene, its pixels then run along
//
//   x' = (cos turn, 0, sin turn),   y' = (-sin tilt sin turn, cos tilt, sin tilt cos turn)
#pragma once

namespace glasswing {

struct PanelPose {
  double away_mm = 0.0;   // along z
  double tilt_deg = 0.0;  // the lower edge goes away
  double turn_deg = 0.0;  // the right edge goes away
  friend bool operator==(const PanelPose&, const PanelPose&) = default;
};

}  // namespace glasswing
