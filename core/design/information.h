// The information of patterns about one pixel's footprints theta = (F; R, c, Sigma of each). A sample i has
// the variance v_i = read^2 + light_i / full well, and the Fisher information is
//
//   I = sum_i J_i J_i' / v_i + P        J_i: derivatives by theta, pattern_answer.h
//
// P, the inverse of the prior's spread, keeps I regular. I^-1 bounds the covariance of any unbiased estimate;
// a least-squares fit reaches it. The resulting error of composites is
//
//   trace(I^-1 M),   M = sum_f power(f) Re(conj(h_f) h_f')        h_f: derivatives of the footprints'
//                                                                  spectrum at f
//
// for a background whose power falls with 1/f^2, as in photographs.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/design/wave_ladder.h"
#include "core/footprint/pattern_answer.h"

namespace glasswing {

struct CameraNoise {
  double read_sd = 0.005;           // of full scale
  std::optional<double> full_well;  // electrons at full scale; empty: no photon noise
  double variance(double light) const { return read_sd * read_sd + (full_well ? light / *full_well : 0.0); }
};

ShownPattern wave_of(const DesignedWave& wave, double phase_rad);
// Adds a wave's two phases, a quarter of a period apart.
void add_phases(const DesignedWave& wave, std::vector<ShownPattern>& patterns);

inline constexpr double kContrast = 0.25;  // rms of a background

class Background {
 public:
  explicit Background(const MonitorExtent& extent);
  // M, in (R, cx, cy, xx, xy, yy) of each footprint: for a background that continues beyond the monitor, or
  // ends with it.
  Eigen::MatrixXd weight(const Footprints& modes) const;
  Eigen::MatrixXd weight_on_monitor(const Footprints& modes) const;

 private:
  Eigen::MatrixXd weight(const Footprints& modes, const MonitorExtent& extent) const;

  struct Detail {
    double fx, fy, power;
  };
  MonitorExtent extent_;
  std::vector<Detail> details_;
};

// J_i / sqrt(v_i), one row per pattern, then black. `noise_scale`: by pattern, its noise over the camera's;
// may be empty.
Eigen::MatrixXd whitened_slopes(const PatternAnswers& patterns, const Footprints& modes,
                                const CameraNoise& noise, std::span<const double> noise_scale = {});

// P, where sigmas are at most `widest_px`.
Eigen::MatrixXd prior_information(int mode_count, const MonitorExtent& extent, double widest_px);

}  // namespace glasswing
