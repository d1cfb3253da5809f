// Fits all footprints of one pixel's channel jointly to all samples of all sweeps over one monitor: the
// Levenberg-Marquardt of Chuang et al. 2000, section 3.2, with each sample weighted by its noise.
//
//   chi2 = sum_i w_i (y_i - f u_i - sum_m y_m(r_i))^2 + w_f f^2        y_m: footprint.h
//        + sum_a w_a (y_a - f u_a - sum_m R_m S_ma)^2                  S_ma: lit_area.h
//        + w_bound sum_m max(R_m - 1, 0)^2
//
// A saturated sample is a lower bound: it is among the samples i only where the model is below it.
//
// f is light that no pattern moves, beyond what was subtracted; 0 if w_f is infinite. The minimum over it is
// taken at every step, which leaves the other unknowns with N - n n'/(U + w_f), where n = sum_i w_i u_i J_i
// and U = sum_i w_i u_i^2, over all samples i and a. Samples a are of white (eq. 13) and of bars. No object
// emits more light than it receives, so weights above 1 are penalised.
//
// All derivatives are analytic, including that of inside(r). With z = (r - c.s) / sigma_r and u =
// exp(-z^2/2):
//   dy/dR = y / R      dy/d(c.s) = y z / sigma_r      dy/d(sigma_r^2) = y (z^2 - 1) / (2 sigma_r^2)
#pragma once

#include <cmath>
#include <vector>

#include "core/footprint/footprint.h"
#include "core/footprint/lit_area.h"
#include "core/footprint/minimise.h"
#include "solver/gaussian/kernels/area_row.h"

namespace glasswing {

// Residuals below this come from the shape of pixels and footprints, regardless of the frames' noise.
inline constexpr double kMinNoise = 1e-4;

inline constexpr double kHidden_px2 = 0.7;  // a footprint wider than this is resolved by flat pixels

// A footprint across the edge of two pixels shows how its light divides between them, but hardly how wide it
// is. Where it is so narrow that the division would depend on more digits of its place than a matte stores,
// the samples must require it: otherwise it is this wide.
inline constexpr double kUsualWidth_px = 0.25;
// In samples of weight 1. All of it costs less than half a standard error.
inline constexpr double kWidthWeight = 3.0;

inline constexpr double kMinStep = 1.0 / 65535.0;  // of frames; a fit that moves by less has converged

// Weights up to this are within the accuracy of cameras and monitors: no object emits more light than it
// receives.
inline constexpr double kMaxWeight = 1.002;

// The positions of the samples of every sweep; the same for all pixels.
struct SampleLayout {
  static constexpr int kPad = 8;  // each sweep's samples fill whole vectors; the rest has weight 0
  struct Sweep {
    StripeAxis axis;
    double first_r_px = 0.0;
    int first = 0;         // index of its first sample, a multiple of kPad
    int count = 0;         // samples
    int padded_count = 0;  // multiple of kPad
  };
  std::vector<Sweep> sweeps;     // at most 16
  std::vector<float> offset_px;  // r - first_r_px of its sweep, ascending

  // Appends a sweep; `r_px` ascends strictly.
  void add(const StripeAxis& axis, const std::vector<double>& r_px);
  int padded_count() const { return static_cast<int>(offset_px.size()); }
};

// A sample of white or of bars, per light of 1.
struct AreaSample {
  LitArea lit;
  double y = 0.0, weight = 0.0;  // as of other samples
  double floor_answer = 1.0;     // u
};

// One pixel's channel, on the scale of a stripe with peak 1, without baseline.
struct PixelSamples {
  const SampleLayout* layout = nullptr;
  std::vector<float> y;  // padded_count values
  // The variance of a typical sample divided by this one's; 0: saturated, missing or padding.
  std::vector<float> weight;
  // Of a saturated sample, whose y is a lower bound: its weight where the model is below; otherwise 0. Empty
  // if none is saturated.
  std::vector<float> at_least = {};
  // Footprints at their true positions; otherwise as stripes see them (footprint.h), and areas must be empty.
  bool placed = true;
  std::vector<AreaSample> areas = {};
  double floor_weight = INFINITY;  // w_f
  // u: what a floor of 1 adds to a sample. May be empty if w_f is infinite.
  std::vector<float> floor_answer = {};
  double bound_weight = 0.0;  // w_bound
  double width_weight = 0.0;  // of kUsualWidth_px, for widths below it
};

// The Gauss-Newton equations N delta = g at some footprints; their cost is chi2.
struct NormalEquations : FootprintEquations {
  double floor = 0.0;  // f
  // The part of chi2 within reach of a mode (4.7 sigma_r), the number of samples there, and the sum of
  // products of neighbouring residuals there.
  double near_chi2 = 0.0, near_neighbours = 0.0;
  int near_count = 0;
};

// Scratch memory of one thread.
struct JointWorkspace {
  std::vector<float> residual;  // after evaluate: y - f - model, as PixelSamples.y
  std::vector<float> columns;   // the derivatives, one after another
  std::vector<float> weight;    // of the samples that count, if some are saturated
  std::vector<AreaRow> areas;   // of PixelSamples.areas
};

void evaluate(const PixelSamples& samples, const Footprints& modes, const MonitorExtent& extent,
              JointWorkspace& workspace, NormalEquations& equations);

struct JointFit {
  Footprints modes;
  double chi2 = 0.0, near_chi2 = 0.0, near_neighbours = 0.0;  // as in NormalEquations
  int near_count = 0;
  double floor = 0.0;  // f
  bool converged = false;
  // Standard errors, from the inverse of N times the residual's variance; infinite where N is singular. Of a
  // mode that sees little more than one pixel, the pixel's own deviation bounds the centre's.
  std::array<double, kMaxFootprints> weight_sd{}, centre_sd_px{};
  double light_sd = 0.0;  // of the sum of all weights
};

// Fits from `start` (1 to 4 modes) to the nearest minimum. Sigma stays positive semi-definite: steps that
// would leave the cone move along its boundary (cone_step.h). Weights may become negative. Converged: the
// next step would be less than a tenth of the estimate's own standard error.
// `held`: parameters that are not changed, one bit each in the order of the equations; their errors are 0.
JointFit fit_jointly(const PixelSamples& samples, const Footprints& start, const MonitorExtent& extent,
                     const StepLimits& limits, JointWorkspace& workspace, unsigned held = 0);

}  // namespace glasswing
