// How well a matte determines the modes of a pixel's channel: the errors of F and all modes due to noise of
// standard deviation s in its samples,
//
//   Cov = s^2 N^-1 M N^-1      N = sum_i w_i J_i J_i'      M = sum_i w_i^2 J_i J_i'
//
// with J_i the derivatives of sample i. Samples are those of stripes and sinusoids, with w the number of
// their pictures, of black, with w = 1, and of white and bars, with w = s^2 / (s^2 / light^2 + e^2), where e
// is how much their model may be off (lit_area.h). s is the least with which no mode's weight has less than
// the standard error of the matte, s^2 N^-1: that of a broad mode may be of its weight alone.
//
// Coefficients c of pyramids are at least 0 and have a prior of standard deviation s (solver/any/
// pyramid_fit.h): their errors are not normal. Noise e of samples and h of the prior is drawn, and the fit
// repeated (randomise, then optimise: Bardsley et al. 2014),
//
//   c_j = argmin_{c >= 0} |w^1/2 (J c - y) - e_j|^2 + |c / s - h_j|^2      Cov = mean of (c_j - c) (c_j - c)'
//
// with y such that without draws the matte's c results, and w the noise's inverse variance. Those of the
// pyramid's places and of their neighbours take part, with which samples may confuse them, and the modes
// that stay beside it.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Dense>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "core/footprint/footprint.h"
#include "core/footprint/lit_area.h"
#include "core/footprint/pattern_answer.h"
#include "core/matte/matte.h"

namespace glasswing {

// Errors of F + sum_k c_k: of F, and of the weights c of these places.
struct PyramidErrors {
  std::vector<Footprint> places;  // of weight 1
  Eigen::MatrixXd root;           // A with Cov = A A', of F and then c; empty: not known
};

// How a matte's header names a picture of white or bars: at this light, `count` times.
v1::LitPicture lit_picture(int texture, const LitArea& lit, double light, int count);

class MatteCovariance {
 public:
  // FAILED_PRECONDITION: the metadata names no samples. DATA_LOSS: it names impossible ones.
  static absl::StatusOr<MatteCovariance> create(const v1::MatteMetadata& metadata);

  // A matrix A with Cov = A A', of F and then R, cx, cy, xx, xy and yy of each mode with a weight, in light,
  // px and px^2. Empty if no mode's standard error is known, or no sample sees a mode.
  Eigen::MatrixXd root(std::span<const Mode> modes) const;

  // Of a pyramid and of the channel's `modes` that it keeps. Empty: not known.
  PyramidErrors errors_of(const PyramidFootprint& pyramid, std::span<const Mode> modes) const;

 private:
  struct Sweep {
    int texture = 0;
    StripeAxis axis;
    double first_r_px = 0.0, step_px = 0.0;
    int count = 0;
    double light = 1.0;
  };
  // Sinusoids on one monitor.
  struct Waves {
    PatternAnswers answers;
    Eigen::VectorXd light, root;  // at the peak; of the number of pictures
  };
  struct Picture {
    int texture = 0;
    LitArea lit;
    double light = 1.0;
    int count = 1;
  };
  // A mode with a weight.
  struct Used {
    Footprint mode;
    int texture = 0;
    Eigen::Index column = 0;  // of its R
  };
  // By a picture of white or bars.
  struct Shown {
    Eigen::VectorXd by;               // J
    double noise = 0.0, error = 0.0;  // 1 / light^2, e
  };
  absl::Status add_sweep(const v1::StripeSweep& sweep);
  absl::Status add_waves(const v1::Mixture& mixture);
  absl::Status add_picture(const v1::LitPicture& picture);
  // Of samples of which all light is known.
  Eigen::MatrixXd information_of(std::span<const Used> modes) const;
  void add_sweep_information(std::span<const Used> modes, const Sweep& sweep,
                             Eigen::MatrixXd& information) const;
  void add_wave_information(std::span<const Used> modes, int texture, Eigen::MatrixXd& information) const;
  // The root of w_i times J_i of a pyramid's places, of these weights.
  Eigen::MatrixXd answers_of(const std::vector<Footprint>& places, const PyramidFootprint& pyramid,
                             const Eigen::VectorXd& weight) const;
  // Those that a footprint changes: [first, second).
  static std::pair<int, int> seen_samples(const Footprint& mode, const Sweep& sweep);
  // Sets the derivatives of samples [begin, end) by one mode: one row each, columns as in root().
  void set_derivatives(const Footprint& mode, const Sweep& sweep, int begin, int end,
                       Eigen::Ref<Eigen::MatrixXd> by) const;
  std::vector<Shown> shown(std::span<const Used> modes) const;

  std::vector<MonitorExtent> extents_;  // by texture
  std::vector<Sweep> sweeps_;
  std::map<int, Waves> waves_;  // by texture
  std::vector<Picture> pictures_;
};

}  // namespace glasswing
