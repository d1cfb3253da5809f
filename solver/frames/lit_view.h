// What pixels that see one monitor past the object should record of a picture on it, by the smooth map of the
// empty stage (stage_map.h):
//
//   light = black + contrast h,    h = 1 for white, 0 or 1 for bars, (s / s_r) exp(...) for stripes
//
// with the footprint that the map gives each pixel. Near a bar's edge flat pixels beat with the camera's, as
// no smooth footprint does: pixels there are left out.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "core/footprint/footprint.h"
#include "solver/background/stage_layout.h"
#include "solver/background/stage_maps.h"
#include "solver/frames/session_samples.h"

namespace glasswing {

struct LitPixel {
  size_t pixel = 0;                   // of SessionSamples
  StagePoint place;                   // on the monitor
  Footprint seen;                     // through its flat pixels, as stripes see it
  double x_by_x = 1.0, x_by_y = 0.0;  // derivatives of the place, monitor px per camera px
  double y_by_x = 0.0, y_by_y = 1.0;
};

// h, NaN near a bar's edge, and its derivatives by the place on the monitor.
struct ShownLight {
  double h = 0.0, by_x = 0.0, by_y = 0.0;
};

class LitView {
 public:
  // Pixels of `beside` that see this monitor, away from its edges.
  LitView(const SessionSamples& samples, const std::vector<bool>& beside, const EmptyMonitor& monitor,
          const SmoothStage& stage);

  const std::vector<LitPixel>& pixels() const { return pixels_; }

  // What a picture shows at a place: nothing if it is of another kind than solids, bars and stripes.
  class Picture {
   public:
    static std::optional<Picture> of(const v1::Stimulus& stimulus);
    ShownLight at(const LitPixel& pixel, double dx_px, double dy_px) const;
    double level(int channel) const { return level_[channel]; }
    bool is_flat() const { return kind_ == Kind::kSolid; }
    bool is_stripe() const { return kind_ == Kind::kStripe; }
    bool has_dark_parts() const { return !is_flat() || level_ == Levels{}; }

   private:
    using Levels = std::array<double, kChannels>;
    enum class Kind { kSolid, kBars, kStripe };
    Kind kind_ = Kind::kSolid;
    Levels level_{};
    double bar_px_ = 1.0;
    bool vertical_ = true, inverse_ = false;
    double cos_phi_ = 1.0, sin_phi_ = 0.0, sigma_px_ = 1.0, r_px_ = 0.0;
  };

 private:
  std::vector<LitPixel> pixels_;
};

}  // namespace glasswing
