// Finds the light of a footprint so wide that no stripe turns it into a peak: of diffuse, frosted and
// scattering surfaces (Chuang et al. 2000, section 5, asks for weighting functions of that kind). White and
// bars show its amount; bars, and the small part common to all samples, show where it comes from.
//
// Such light is smooth along r, so neighbouring samples are averaged until a step is an eighth of the
// narrowest template. The fit starts at the template, of a few centres and widths, that explains most.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "solver/gaussian/kernels/joint_fit.h"

namespace glasswing {

// Thread-safe.
class BroadLight {
 public:
  // `areas`: those that samples may have, in any order.
  BroadLight(const SampleLayout& layout, std::span<const LitArea> areas, const MonitorExtent& extent);

  struct Found {
    JointFit fit;        // of one mode; its floor is what is left then
    bool shape = false;  // whether its place and widths were fitted: else they are the best template's
  };
  // `rest`: the residual of the samples after other modes, whose areas are those of the constructor, above
  // black, with a finite floor_weight. `noise_sd`: of a sample of weight 1. None unless it earns its
  // parameters (Bayesian information criterion); if it is `expected`, because neighbours have it, any
  // positive light will do. `averaged` and `workspace`: scratch memory of one thread.
  std::optional<Found> find(const PixelSamples& rest, double noise_sd, bool expected, PixelSamples& averaged,
                            JointWorkspace& workspace) const;

  // Whether a mode may be broad light: at least half as wide as the narrowest template, and a weight of 0
  // to 1.
  bool is_broad(const Footprint& mode) const;

 private:
  struct Template {
    Footprint mode;
    std::vector<float> answer;  // of weight 1, as PixelSamples.y
    std::vector<double> lit;    // S, of each kind of area
  };
  void average(const PixelSamples& rest, PixelSamples& averaged) const;
  // The one that takes most from chi2, with its best weight, at most 1; none if that is less than `enough`.
  // Its standard errors are those of noise 1.
  std::optional<JointFit> best_template(const PixelSamples& averaged, double enough) const;

  MonitorExtent extent_;
  int group_ = 1;  // samples averaged
  SampleLayout layout_;
  std::vector<Template> templates_;
};

}  // namespace glasswing
