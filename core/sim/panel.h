// A simulated monitor's panel: converts codes to light. At pixel (x, y), `lit` after the panel was switched
// on, channel c emits
//
//   p_c     = black + (1 - black) * (code_c / (2^bits - 1))^gamma
//   light_c = radial_shading(x, y) * (1 - drift)^minutes
//             * ((1 - 2 crosstalk) p_c + crosstalk * (the other two p))
//
// so that no light exceeds 1.0.
#pragma once

#include <vector>

#include "core/base/time.h"
#include "core/image/image.h"

namespace glasswing {

struct PanelModel {
  int bits = 16;                  // of a code, 8 to 16
  double gamma = 1.0;             // more than 0
  double black = 0.0;             // light at code 0, of full scale; 0 to 1
  double crosstalk = 0.0;         // share of a primary's light in each other channel; 0 to 1/3
  double falloff = 0.0;           // share of light missing in the corners (radial_shading.h); 0 to 1
  double drift_per_minute = 0.0;  // share of brightness lost per minute; 0 to 1
  friend bool operator==(const PanelModel&, const PanelModel&) = default;
};

class Panel {
 public:
  explicit Panel(const PanelModel& model);
  // Converts `codes`, each 0 to 2^bits - 1, to light (radiance_of). The whole picture has the brightness of
  // one moment, `lit` after the panel was switched on.
  Image16 emitted(Image16 codes, nanoseconds lit) const;

 private:
  const PanelModel model_;
  std::vector<float> light_of_code_;
};

}  // namespace glasswing
