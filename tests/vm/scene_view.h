// What an ideal camera with a global shutter sees of the monitors through a scene.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/sim/emission_timeline.h"
#include "core/sim/scene.h"
#include "core/sim/sensor.h"
#include "core/sim/transport.h"

namespace glasswing {

class SceneView {
 public:
  SceneView(const std::string& scene, int width_px, int height_px, double full_scale_exposure_ms);
  // Waits for the light; black where it does not come in time.
  Image16 expose(const EmissionTimeline& timeline, const ExposureWindow& window, bool object);

 private:
  const Transport& transport(const std::vector<MonitorEmission>& emission, bool object);

  const std::string scene_;
  const int width_px_, height_px_;
  SensorModel sensor_;
  std::optional<Transport> with_, without_;  // the object
};

}  // namespace glasswing
