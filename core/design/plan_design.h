// Plans for a number of images and a camera's noise: the patterns are chosen by how well they determine a
// footprint.
//
// Patterns are compared by the expected error of composites (information.h), as the geometric mean over a
// prior of footprints: one to `modes` places anywhere on the monitor, log-uniform sigmas, any orientation.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/design/information.h"
#include "core/design/wave_ladder.h"
#include "core/footprint/pattern_answer.h"
#include "core/pattern/plan_fit.h"

namespace glasswing {

struct FootprintPrior {
  int modes = 2;                       // most places of a pixel, 1 to 4
  double low_px = 0.3, high_px = 4.0;  // sigmas on the monitor
};

// The prior if nothing is known about the object: sigmas of 0.3 to 4 px for a monitor of 128 px, and in
// proportion to the root of its longer side, as plan_fit.h chooses stripes; none below `blur_px`.
FootprintPrior usual_prior(const MonitorExtent& extent, int modes, double blur_px = 0.0);

// Standard deviations of one channel, medians over the prior.
struct ExpectedErrors {
  double centre_px = 0.0;  // along an axis
  double width_px = 0.0;   // of sqrt((xx + yy) / 2)
  double weight = 0.0;
  double composite = 0.0;  // rms of full scale, before backgrounds of contrast 0.25
};

// Footprints of the prior, always the same ones.
std::vector<Footprints> footprints_of(const FootprintPrior& prior, const MonitorExtent& extent);

// For one pixel's footprints with these patterns and black, in (R, cx, cy, xx, xy, yy) of each.
// `noise_scale`: by pattern, its noise over the camera's; may be empty.
Eigen::MatrixXd expected_covariance(const PatternAnswers& patterns, const Footprints& modes,
                                    const CameraNoise& noise, const FootprintPrior& prior,
                                    std::span<const double> noise_scale = {});

ExpectedErrors expected_errors(const PatternAnswers& patterns, const CameraNoise& noise,
                               const FootprintPrior& prior, std::span<const double> noise_scale = {});

// The patterns that a plan shows with the object on one monitor, except black.
absl::StatusOr<std::vector<ShownPattern>> shown_by(const v1::Plan& plan, const v1::Monitor& monitor);

// A camera's own. For an uncalibrated one 0.5 % of full scale: a solve's residuals show the rest.
CameraNoise noise_of(const v1::Camera& camera);

struct DesignWish {
  int images = 100;  // with and without the object, on all monitors, at each exposure
  CameraNoise noise;
  int modes = 2;                             // most places of a pixel
  std::optional<FootprintPrior> prior = {};  // of as many modes; empty: the usual one
  bool any_footprints = false;               // of any shape (shape_waves.h), not only of Gaussians
};

struct DesignedPlan {
  v1::Plan plan;
  std::string chosen;  // human-readable
  FootprintPrior prior;
  ExpectedErrors expected;
  // The best of the other kind, if this few images suffice for it.
  std::string other;
  std::optional<ExpectedErrors> other_expected;
};

inline constexpr int kMinDesignImages = 28;  // a monitor

// A plan of method gaussian. INVALID_ARGUMENT: no monitor, too few images, or the camera is too slow.
absl::StatusOr<DesignedPlan> design_plan(const DesignWish& wish, const RigLimits& rig);

// A wave's noise over the camera's; infinite for one that cannot be shown.
using WaveNoiseScale = std::function<double(const DesignedWave&)>;

// White and coarse bars.
std::vector<ShownPattern> coarse_stage(const MonitorExtent& extent);

// For waves in two phases each, with black and the coarse stage; infinite if one cannot be shown.
ExpectedErrors expected_of_waves(const MonitorExtent& extent, const std::vector<DesignedWave>& waves,
                                 const CameraNoise& noise, const FootprintPrior& prior,
                                 const WaveNoiseScale& noise_scale);

// The shortest period of the best ladder of `count` waves in two phases each, with black, white and coarse
// bars: at least `finest_px`. Without `noise_scale` all waves have the camera's noise.
double best_shortest_px(const MonitorExtent& extent, const std::vector<double>& phi_deg, int count,
                        double finest_px, const CameraNoise& noise, const FootprintPrior& prior,
                        const WaveNoiseScale& noise_scale);

}  // namespace glasswing
