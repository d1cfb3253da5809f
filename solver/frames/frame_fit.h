// Least squares of one frame's gain, offset and shift (frame_report.h) over all lanes that see its monitor
// beside the object, with Tukey's biweight.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "solver/frames/frame_report.h"
#include "solver/frames/lit_view.h"
#include "solver/frames/session_samples.h"

namespace glasswing {

// One monitor as the pixels beside the object see it. By lit pixel, and lane of the pixel.
struct SeenMonitor {
  EmptyMonitor monitor;
  LitView view;
  std::vector<float> black, contrast;
  double cut_off_sd = 0.0;  // of noise of which the camera cut off what lay below black; 0: none
};

class FrameFit {
 public:
  FrameFit(const SessionSamples& samples, const SeenMonitor& seen, const LitView::Picture& picture,
           double noise_sd);

  // `light`: of this frame, by lane. `offset`: its expected value; a picture without dark parts does not
  // measure it.
  FrameMeasure fit(std::span<const float> light, const std::array<double, kChannels>& offset = {});

  // The part of the normal equations of ghosts that gain and offset do not explain, at the last fit.
  struct GhostEquations {
    Eigen::Matrix<double, kGhosts, kGhosts> normal = Eigen::Matrix<double, kGhosts, kGhosts>::Zero();
    Eigen::Matrix<double, kGhosts, 1> right = Eigen::Matrix<double, kGhosts, 1>::Zero();
    double chi_square = 0.0, count = 0.0;
  };
  // `last`: light of the previous frames, the latest first.
  GhostEquations ghosts(std::span<const float> light, std::span<const std::span<const float>> last) const;

 private:
  static constexpr Eigen::Index kShift = 2 * kChannels, kUnknowns = kShift + 2;
  using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
  using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
  struct Sums {
    // Of a channel: by gain, offset and shift.
    std::array<Eigen::Matrix4d, kChannels> normal;
    std::array<Eigen::Vector4d, kChannels> right;
    double chi_square = 0.0, count = 0.0;
  };
  void show();
  // What the camera records of this light on average, where it clips noise (clipped_noise.h), and its
  // derivative.
  struct Recorded {
    double light = 0.0, by_light = 1.0;
  };
  Recorded recorded(double light) const;
  Sums sums(std::span<const float> light) const;
  // The residual of the light at a lane of a lit pixel, if that moves by `slope2`, h squared for each px
  // squared.
  struct Rest {
    size_t channel = 0;
    double whole = 0.0, by_light = 1.0;  // of white; of what the camera records
    double rest = 0.0, part = 0.0;       // how much it counts: 0 to 1,
    double weight = 0.0;                 // over its variance
  };
  Rest rest_of(std::span<const float> light, size_t lit, size_t l, double h, double slope2) const;
  // With the shift once more, of which it may be a part.
  void measure_turn(std::span<const float> light, FrameMeasure& measure) const;

  const SessionSamples& samples_;
  const SeenMonitor& seen_;
  const LitView::Picture& picture_;
  const double noise_sd_;
  Unknowns at_;
  double scale_ = 1.0;
  std::vector<ShownLight> shown_;  // by lit pixel
  double shown_dx_px_ = 0.0, shown_dy_px_ = 0.0;
};

}  // namespace glasswing
