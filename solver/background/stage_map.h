// The empty stage as a surface: where on a monitor each point of the camera's picture looks, as one smooth
// map.
//
//   (u, v) = H(x, y) + sum over i + j <= degree of (a_ij, b_ij) T_i(x') T_j(y')
//
// H is a homography (a flat monitor in front of a pinhole camera), T Chebyshev polynomials of the picture's
// coordinates scaled to [-1, 1]: lens distortion, and a monitor that is not exactly flat. The degree, none or
// 2 to 6, is the one that predicts best by Akaike's criterion. A pixel's footprint is one spot in the
// picture, the pixel behind the lens, mapped to the monitor: Sigma = spot J J', with J the map's Jacobian.
//
// The fit is by iteratively reweighted least squares with Tukey's biweight, over the positions at which
// pixels were found along some direction, each with its standard deviation.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace glasswing {

// Where a camera pixel looks, along one direction.
struct Sighting {
  double x_px = 0.0, y_px = 0.0;          // in the picture: pixel (0, 0) has its centre at 0.5, 0.5
  double cos_phi = 1.0, sin_phi = 0.0;    // direction on the monitor
  double position_px = 0.0, sd_px = 1.0;  // along it
};

struct StagePoint {
  double x_px = 0.0, y_px = 0.0;                    // on the monitor; may lie beyond its edges
  double xx_px2 = 0.0, xy_px2 = 0.0, yy_px2 = 0.0;  // the footprint's covariance
};

// The standard deviation of normal values from the median of their sizes, which is not empty and is
// reordered.
double sd_by_median(std::vector<double>& sizes);

class StageMap {
 public:
  struct Fitted;
  // To sightings in a picture of this size. Rejected: fewer than kMinSightings, or more than kMaxRefuted of
  // them beyond four times the others' scatter.
  static Fitted fit(std::span<const Sighting> sightings, int width_px, int height_px);

  // At a point of the picture.
  StagePoint at(double x_px, double y_px) const;

  int degree() const { return degree_; }  // 0: a homography
  // Standard deviation of the map itself there, rms of both axes.
  double sd_px(double x_px, double y_px) const;
  // Variance of a pixel's spot in the picture. 1/12 is a sharp lens.
  double spot_px2() const { return spot_px2_; }
  void set_spot_px2(double spot_px2) { spot_px2_ = spot_px2; }

  static constexpr int kMinSightings = 60;
  static constexpr int kMaxDegree = 6;
  static constexpr double kMaxRefuted = 0.3;

 private:
  friend class StageMapFit;
  std::array<double, 2> scaled(double x_px, double y_px) const;
  // (u, v) at scaled coordinates, with the values of the terms there.
  std::array<double, 2> place(double x, double y, std::span<const double> terms) const;

  double width_px_ = 1.0, height_px_ = 1.0;
  std::array<double, 8> homography_{};  // of scaled coordinates: rows (0 1 2) (3 4 5) (6 7 1)
  int degree_ = 0;
  Eigen::Matrix2Xd rest_;       // by term
  Eigen::MatrixXd covariance_;  // of the terms' coefficients, u and v of each in turn
  double spot_px2_ = 1.0 / 12.0;
};

struct StageMap::Fitted {
  std::optional<StageMap> map;
  std::string refused;  // why there is none, as the end of a sentence
};

}  // namespace glasswing
