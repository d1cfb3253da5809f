// How well a matte determines the modes of a pixel's channel: the errors of F and all modes due to noise of
// standard deviation s in its samples,
//
//   Cov = s^2 N^-1 M N^-1      N = sum_i w_i J_i J_i'      M = sum_i w_i^2 J_i J_i'
//
// with J_i the derivatives of sample i. Samples are those of the sweeps and of black, with w = 1, and of
// white and bars, with w = s^2 / (s^2 / light^2 + e^2), where e is how much their model may be off
// (lit_area.h). Coefficients of pyramids have a prior (solver/any/pyramid_fit.h). s is such that the
// strongest mode's weight has the standard error of the matte, s^2 N^-1.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/statusor.h>

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "core/footprint/footprint.h"
#include "core/footprint/lit_area.h"
#include "core/matte/matte.h"

namespace glasswing {

class MatteCovariance {
 public:
  // FAILED_PRECONDITION: the metadata names no sweeps. DATA_LOSS: it names impossible samples.
  static absl::StatusOr<MatteCovariance> create(const v1::MatteMetadata& metadata);

  // A matrix A with Cov = A A', of F and then R, cx, cy, xx, xy and yy of each mode with a weight, in light,
  // px and px^2. Empty if the strongest mode's standard error is not known, or no sweep sees a mode.
  Eigen::MatrixXd root(std::span<const Mode> modes) const;

  // The variance of F + sum_k light(k) c_k, of a pyramid's coefficients and the channel's `modes` that are
  // kept: that of the Gaussian posterior (sum_i w_i J_i J_i' + prior^-1)^-1 of those above 0, and of their
  // neighbours, to which light may belong as far as the samples can tell; and that between the pyramid and
  // the modes, where the footprint is the average of both.
  double variance(const PyramidFootprint& pyramid, std::span<const Mode> modes,
                  absl::FunctionRef<double(const Footprint&)> light) const;

 private:
  struct Sweep {
    int texture = 0;
    StripeAxis axis;
    double first_r_px = 0.0, step_px = 0.0;
    int count = 0;
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
  Eigen::MatrixXd of_sweeps(std::span<const Used> modes) const;
  // Sets the derivatives of samples [begin, end) by one mode: one row each, columns as in root().
  void set_derivatives(const Footprint& mode, const Sweep& sweep, int begin, int end,
                       Eigen::Ref<Eigen::MatrixXd> by) const;
  std::vector<Shown> shown(std::span<const Used> modes) const;

  std::vector<MonitorExtent> extents_;  // by texture
  std::vector<Sweep> sweeps_;
  std::vector<Picture> pictures_;
};

}  // namespace glasswing
