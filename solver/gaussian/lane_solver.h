// Fits one lane, a channel of one pixel, on one monitor: values in, values out. Most lanes are done by
// fit_batch; this is for those that it does not explain, that are clipped by an edge of the monitor, or that
// saturate.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "solver/gaussian/kernels/joint_batch.h"
#include "solver/gaussian/mode_search.h"
#include "solver/gaussian/swept_monitor.h"

namespace glasswing {

struct LaneSamples {
  PixelSamples sweeps;       // above the baseline; the floor is fixed
  std::vector<Peaks> peaks;  // by sweep
  // Of white and bars in the monitor's order: radiance, and its variance as in SampleTile.
  std::vector<double> area, area_variance;
  double noise_sd = 0.0;               // of a sample of weight 1
  double black = 0.0, baseline = 0.0;  // radiance of the black frame, and without stripes
  double floor_weight = 1.0;           // of the black frame, in samples of weight 1
};

struct LaneFit {
  JointFit fit;  // its floor is above black
  WhiteRest beyond;
};

// Why each mode was accepted or rejected, as readable text; see `glasswing-solver explain`.
using LaneNotes = std::vector<std::string>;

// Whether a batch's fit needs nothing more: it has converged, each of its modes is significant, and sweeps,
// white and bars show only noise besides.
bool is_done(const BatchFit& fit, double noise_sd);

class LaneSolver {
 public:
  // `max_modes`: 1 to kMaxFootprints. Keeps a reference.
  LaneSolver(const SweptMonitor& monitor, int max_modes) : monitor_(monitor), max_modes_(max_modes) {}

  // The modes of the sweeps. `batch`: the result of fit_batch, if any.
  LaneFit search(const LaneSamples& samples, const BatchFit* batch, LaneNotes* notes = nullptr);
  // The fit of sweeps, white and bars together, starting from search().
  LaneFit settle(const LaneSamples& samples, LaneFit found, bool broad_light_expected,
                 LaneNotes* notes = nullptr);
  // Drops modes that the samples do not require, and holds at the monitor's edge those that may be anywhere
  // beyond it.
  LaneFit judge(const LaneSamples& samples, LaneFit settled, LaneNotes* notes = nullptr);

 private:
  // All samples above black, with a floor; white and bars as far as they can be trusted given `fit`.
  PixelSamples everything(const LaneSamples& samples, const JointFit& fit) const;
  void weigh_areas(const LaneSamples& samples, const JointFit& fit, PixelSamples& all) const;
  WhiteRest held_against_white(const LaneSamples& samples, const JointFit& fit) const;
  // Areas are reweighted when the modes change; none without a sound minimum.
  std::optional<JointFit> fit_all(const LaneSamples& samples, const Footprints& start, PixelSamples& all);
  // The residual of the samples after `modes`.
  PixelSamples left_by(const PixelSamples& all, const Footprints& modes);
  // The fit with broad light, if white shows more than the modes and there is any.
  std::optional<JointFit> with_broad_light(const LaneSamples& samples, const LaneFit& found, bool expected);
  // If the samples do not show how far outside the monitor a mode is: the same light from a mode at its edge.
  // False: that explains them worse; the mode stays, and the fit counts as not converged.
  bool hold_on_monitor(const LaneSamples& samples, int mode, LaneFit& settled);

  const SweptMonitor& monitor_;
  const int max_modes_;
  PixelSamples averaged_;
  JointWorkspace workspace_;
};

// Standard errors beyond which something is not noise.
inline constexpr double kBeyondNoise = 4.0;

// Whether samples of a lane differ from its fit by more than noise explains, and by enough to affect
// composites: the difference relative to the highest sample, rms; 0: they do not.
double unexplained(const LaneFit& lane, double noise_sd, const SampleLayout& layout);

// Whether the modes approximate light of another shape, such as a ring: they are the maximum number, wider
// than points, and no sweep shows a peak for each. So few directions do not determine such a shape.
bool is_of_another_shape(const Footprints& modes, const SampleLayout& layout);

// White shows light that the modes do not have.
bool contradicts_white(const WhiteRest& beyond);

}  // namespace glasswing
