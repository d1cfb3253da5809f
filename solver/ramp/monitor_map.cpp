#include "solver/ramp/monitor_map.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/median.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

constexpr size_t kMaxFittedPixels = 40'000;
constexpr int kRounds = 30;
constexpr double kMinLight = 0.1;      // of the brightest pixel: darker than any colour of the ramp
constexpr double kMinSpread = 0.1;     // of u and v: the minimum visible part of the monitor
constexpr double kMaxResidual = 0.05;  // of the monitor's longer side

struct Pixel {
  double x_px = 0.0, y_px = 0.0;
  Eigen::Vector3d light;
};

// Robust weights for residuals of which most are normal; residuals within rounding count fully.
std::vector<double> robust_weights(const std::vector<double>& residuals, double min_sd) {
  const double sd = std::max(median(residuals) / 0.6745, min_sd);
  std::vector<double> weights(residuals.size());
  for (size_t i = 0; i < weights.size(); ++i) {
    const double z = residuals[i] / (3.0 * sd);
    weights[i] = 1.0 / ((1.0 + z * z) * (1.0 + z * z));
  }
  return weights;
}

std::vector<Pixel> lit_pixels(const RadianceImage& empty) {
  const size_t count = empty.samples.size() / 3;
  const auto step = static_cast<int>(
      std::ceil(std::sqrt(static_cast<double>(count) / static_cast<double>(kMaxFittedPixels))));
  std::vector<Pixel> pixels;
  double brightest = 0.0;
  for (int y = 0; y < empty.height_px; y += step) {
    for (int x = 0; x < empty.width_px; x += step) {
      const Eigen::Vector3d light(static_cast<double>(empty.at(x, y, 0)),
                                  static_cast<double>(empty.at(x, y, 1)),
                                  static_cast<double>(empty.at(x, y, 2)));
      brightest = std::max(brightest, light.sum());
      pixels.push_back({x + 0.5, y + 0.5, light});
    }
  }
  std::erase_if(pixels, [&](const Pixel& pixel) { return pixel.light.sum() <= kMinLight * brightest; });
  return pixels;
}

absl::Status no_ramp(const char* why) {
  return absl::FailedPreconditionError(std::string("the empty stage does not show the ramp: ") + why);
}

absl::StatusOr<Eigen::Vector3d> fit_plane(const std::vector<Pixel>& pixels) {
  std::vector<double> weights(pixels.size(), 1.0), residuals(pixels.size());
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Eigen::Vector3d sums = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < pixels.size(); ++i) {
      squares += weights[i] * pixels[i].light * pixels[i].light.transpose();
      sums += weights[i] * 2.0 * pixels[i].light;
    }
    // One colour, or a line of colours, spans no plane.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(squares);
    if (!(eigen.eigenvalues()[0] > 1e-4 * eigen.eigenvalues()[2]))
      return no_ramp("its colours span no plane");
    plane = squares.ldlt().solve(sums);
    for (size_t i = 0; i < pixels.size(); ++i) residuals[i] = std::abs(plane.dot(pixels[i].light) - 2.0);
    weights = robust_weights(residuals, 1e-6);
  }
  if (!(plane.minCoeff() > 0.0) || median(residuals) > 0.1) return no_ramp("its colours differ");
  return plane;
}

}  // namespace

absl::StatusOr<MonitorMap> MonitorMap::fit(const RadianceImage& empty, int monitor_width_px,
                                           int monitor_height_px) {
  const std::vector<Pixel> pixels = lit_pixels(empty);
  if (pixels.size() < 100) return no_ramp("it is black");
  GW_ASSIGN_OR_RETURN(const Eigen::Vector3d plane, fit_plane(pixels));
  const double size_px = std::max(empty.width_px, empty.height_px);
  std::vector<Eigen::Vector2d> told(pixels.size());  // monitor px
  std::array<std::vector<double>, 2> shares;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const Eigen::Vector3d& light = pixels[i].light;
    const double level = 0.5 * plane.dot(light);
    const double u = (plane[0] * light[0] / level - 0.1) / 0.8, v = (plane[1] * light[1] / level - 0.1) / 0.8;
    told[i] = {u * monitor_width_px, v * monitor_height_px};
    shares[0].push_back(u);
    shares[1].push_back(v);
  }
  for (std::vector<double>& share : shares) {
    std::ranges::sort(share);
    if (share[share.size() * 9 / 10] - share[share.size() / 10] < kMinSpread)
      return no_ramp("its colours hardly change over the picture");
  }
  using Row = Eigen::Matrix<double, 8, 1>;
  std::vector<double> weights(pixels.size(), 1.0), residuals(pixels.size());
  Row h = Row::Zero();
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, 8, 8> squares = Eigen::Matrix<double, 8, 8>::Zero();
    Row sums = Row::Zero();
    for (size_t i = 0; i < pixels.size(); ++i) {
      const double x = pixels[i].x_px / size_px, y = pixels[i].y_px / size_px;
      const double w = h[6] * x + h[7] * y + 1.0, weight = weights[i] / (w * w);
      for (int axis = 0; axis < 2; ++axis) {
        Row row = Row::Zero();
        row.segment<3>(3 * axis) << x, y, 1.0;
        row.tail<2>() << -x * told[i][axis], -y * told[i][axis];
        squares += weight * row * row.transpose();
        sums += weight * told[i][axis] * row;
      }
    }
    h = squares.ldlt().solve(sums);
    for (size_t i = 0; i < pixels.size(); ++i) {
      const double x = pixels[i].x_px / size_px, y = pixels[i].y_px / size_px;
      const double w = h[6] * x + h[7] * y + 1.0;
      residuals[i] = std::hypot((h[0] * x + h[1] * y + h[2]) / w - told[i][0],
                                (h[3] * x + h[4] * y + h[5]) / w - told[i][1]);
    }
    weights = robust_weights(residuals, 1e-6);
  }
  MonitorMap map;
  map.residual_px_ = median(residuals);
  if (!h.allFinite() || map.residual_px_ > kMaxResidual * std::max(monitor_width_px, monitor_height_px))
    return no_ramp("its colours do not lie in the ramp's order");
  std::copy(plane.begin(), plane.end(), map.plane_.begin());
  for (size_t i = 0; i < 8; ++i) map.h_[i] = h[i] / (i % 3 == 2 && i < 6 ? 1.0 : size_px);
  return map;
}

std::array<double, 4> MonitorMap::slope(double x_px, double y_px) const {
  const double w = h_[6] * x_px + h_[7] * y_px + 1.0;
  const std::array<double, 2> at = place(x_px, y_px);
  return {(h_[0] - h_[6] * at[0]) / w, (h_[1] - h_[7] * at[0]) / w, (h_[3] - h_[6] * at[1]) / w,
          (h_[4] - h_[7] * at[1]) / w};
}

}  // namespace glasswing
