#include "compositing/dataset/point_errors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "core/base/for_rows.h"

namespace glasswing {
namespace {

using Eigen::Vector3d, Eigen::Vector3f;

constexpr int kReach = 2;                       // pixels, of the window
constexpr int kMinAlong = 3;                    // second differences in it that have a median
constexpr int kMinPairs = 4;                    // of opposite ones
constexpr int kMinDifferences = 6;              // in all directions
constexpr double kVarianceOfDifference = 12.0;  // two axes of 1 + 4 + 1
constexpr double kBendError = 0.25;
constexpr double kWide = 2.0;  // apertures, beyond which neighbours do not explain a footprint

double median(std::vector<double>& values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

class Neighbours {
 public:
  Neighbours(const DatasetView& view, const std::vector<PointFootprint>& footprints,
             const ScreenPoints& points)
      : view_(view),
        footprints_(footprints),
        points_(points),
        width_(view.matte.width_px()),
        height_(view.matte.height_px()) {
    cuts2_.reserve(points.known.size());
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x)
        cuts2_.push_back(std::pow(footprints[y * width_ + x].sigma_mm * shift_of_cut(missing(x, y)), 2));
    }
    std::vector<double> apertures;
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        if (const std::optional<double> own = aperture_px2(x, y)) apertures.push_back(*own);
      }
    }
    if (!apertures.empty()) aperture_px2_ = median(apertures);
    for (size_t k = 0; k < kAlong.size(); ++k) {
      differences_[k].reserve(points.known.size());
      for (int y = 0; y < height_; ++y) {
        for (int x = 0; x < width_; ++x) differences_[k].push_back(difference(x, y, kAlong[k]));
      }
    }
  }

  struct Corrected {
    Vector3d at_mm;
    double sd_mm;
  };
  Corrected corrected(int x, int y) const {
    const int pixel = y * width_ + x;
    std::vector<double> squares;
    std::array<std::optional<Vector3d>, kAlong.size()> curvature;
    for (size_t k = 0; k < kAlong.size(); ++k) curvature[k] = add_scatter(x, y, k, squares);
    const double fit = points_.sd_mm[pixel], sigma = footprints_[pixel].sigma_mm;
    double variance = fit * fit + 0.5 * (cuts2_[pixel] + pose_variance(pixel));
    if (std::ssize(squares) >= kMinDifferences) {
      const double scatter2 = median(squares) / (kVarianceOfDifference * std::numbers::ln2);
      variance += std::max(scatter2 - fit * fit, 0.0);
    }
    const std::optional<double> own = aperture_px2(x, y);
    if (!own || *own > kWide * aperture_px2_ || !curvature[0] || !curvature[1])
      return {.at_mm = points_.at_mm[pixel], .sd_mm = std::sqrt(variance + 0.5 * sigma * sigma)};
    const Vector3d bend = 0.5 * aperture_px2_ * (*curvature[0] + *curvature[1]);
    return {.at_mm = points_.at_mm[pixel] - bend,
            .sd_mm = std::sqrt(variance + 0.5 * kBendError * kBendError * bend.squaredNorm())};
  }

 private:
  struct Step {
    int x, y;
  };
  static constexpr std::array<Step, 4> kAlong{{{1, 0}, {0, 1}, {1, 1}, {1, -1}}};

  // The pixel's number, if its point is known.
  std::optional<int> known(int x, int y) const {
    if (x < 0 || y < 0 || x >= width_ || y >= height_) return std::nullopt;
    const int pixel = y * width_ + x;
    return points_.known[pixel] != 0 ? std::optional(pixel) : std::nullopt;
  }
  // The neighbour that saw the same surfaces.
  std::optional<int> beside(int x, int y, Step step) const {
    const std::optional<int> here = known(x, y), there = known(x + step.x, y + step.y);
    if (!here || !there) return std::nullopt;
    const double pitch_mm = view_.monitors[footprints_[*here].texture].pitch_mm;
    const double reach_mm = kTogether_px * pitch_mm * std::hypot(step.x, step.y);
    return (points_.at_mm[*there] - points_.at_mm[*here]).norm() < reach_mm ? there : std::nullopt;
  }
  // NaN: not known.
  Vector3f difference(int x, int y, Step step) const {
    const std::optional<int> before = beside(x, y, {-step.x, -step.y}), after = beside(x, y, step);
    if (!before || !after) return Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
    const Vector3d& at = points_.at_mm[y * width_ + x];
    return (points_.at_mm[*before] - 2.0 * at + points_.at_mm[*after]).cast<float>();
  }

  // What cut footprints make of a second difference's square.
  double of_cuts(int pixel, size_t along) const {
    const int step = kAlong[along].y * width_ + kAlong[along].x;
    return 4.0 * cuts2_[pixel] + cuts2_[pixel - step] + cuts2_[pixel + step];
  }

  // Adds the squares of second differences about their median, and returns that. Those of opposite pixels are
  // averaged if there are enough, since curvature may rise or fall within the window.
  std::optional<Vector3d> add_scatter(int x, int y, size_t along, std::vector<double>& squares) const {
    std::vector<int> around, opposite;  // pixels; the latter -1: none
    for (int v = std::max(y - kReach, 0); v <= std::min(y + kReach, height_ - 1); ++v) {
      for (int u = std::max(x - kReach, 0); u <= std::min(x + kReach, width_ - 1); ++u) {
        if (!has_difference(u, v, along)) continue;
        around.push_back(v * width_ + u);
        const int s = 2 * x - u, t = 2 * y - v;
        opposite.push_back(has_difference(s, t, along) ? t * width_ + s : -1);
      }
    }
    if (std::ssize(around) < kMinAlong) return std::nullopt;
    const std::vector<Vector3f>& all = differences_[along];
    Vector3d middle;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> values;
      for (const int pixel : around) values.push_back(all[pixel][axis]);
      middle[axis] = median(values);
    }
    const auto off = [&](int pixel) -> Vector3d { return all[pixel].cast<double>() - middle; };
    std::vector<double> of_pairs;
    for (size_t i = 0; i < around.size(); ++i) {
      const int a = around[i], b = opposite[i];
      if (a <= b) {  // each pair once, and the middle with itself
        const double pair =
            a == b ? off(a).squaredNorm() - of_cuts(a, along)
                   : 0.5 * ((off(a) + off(b)).squaredNorm() - of_cuts(a, along) - of_cuts(b, along));
        of_pairs.push_back(std::max(pair, 0.0));
      }
    }
    if (std::ssize(of_pairs) >= kMinPairs) {
      squares.insert(squares.end(), of_pairs.begin(), of_pairs.end());
    } else {
      for (const int pixel : around)
        squares.push_back(std::max(off(pixel).squaredNorm() - of_cuts(pixel, along), 0.0));
    }
    return middle;
  }
  bool has_difference(int x, int y, size_t along) const {
    return x >= 0 && y >= 0 && x < width_ && y < height_ && !differences_[along][y * width_ + x].hasNaN();
  }

  // The share of light that the pixel lacks against its brightest neighbour, beyond its noise.
  double missing(int x, int y) const {
    constexpr double kNoise = 2.0;  // standard errors
    const PointFootprint& footprint = footprints_[y * width_ + x];
    const double own = footprint.weight + kNoise * footprint.weight_sd;
    double most = own;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        if (const std::optional<int> there = beside(x, y, {dx, dy}))
          most = std::max(most, footprints_[*there].weight);
      }
    }
    return most > 0.0 ? 1.0 - own / most : 0.0;
  }

  // Of the pixel, from its footprint and the steps to its neighbours.
  std::optional<double> aperture_px2(int x, int y) const {
    const int pixel = y * width_ + x;
    double steps2 = 0.0;
    for (const Step step : {kAlong[0], kAlong[1]}) {
      const std::optional<int> before = beside(x, y, {-step.x, -step.y}), after = beside(x, y, step);
      if (!before && !after) return std::nullopt;
      const double count = before && after ? 2.0 : 1.0;
      steps2 += ((points_.at_mm[after.value_or(pixel)] - points_.at_mm[before.value_or(pixel)]) / count)
                    .squaredNorm();
    }
    const double sigma = footprints_[pixel].sigma_mm;
    return steps2 > 0.0 ? std::optional(2.0 * sigma * sigma / steps2) : std::nullopt;
  }

  // Of the point in space, mm^2.
  double pose_variance(int pixel) const {
    const int texture = footprints_[pixel].texture;
    const Vector3d arm = points_.at_mm[pixel] - view_.monitors[texture].corner_mm;
    Eigen::Matrix<double, 3, 6> by_pose;  // a turn about the camera's axes, then a translation
    by_pose << Vector3d::UnitX().cross(arm), Vector3d::UnitY().cross(arm), Vector3d::UnitZ().cross(arm),
        Eigen::Matrix3d::Identity();
    return (by_pose * view_.pose_covariances[texture] * by_pose.transpose()).trace();
  }

  const DatasetView& view_;
  const std::vector<PointFootprint>& footprints_;
  const ScreenPoints& points_;
  const int width_, height_;
  std::vector<double> cuts2_;  // mm^2, by pixel
  double aperture_px2_ = 0.0;
  std::array<std::vector<Vector3f>, kAlong.size()> differences_;
};

}  // namespace

void correct_points(const DatasetView& view, const std::vector<PointFootprint>& footprints,
                    ScreenPoints& points) {
  const Neighbours neighbours(view, footprints, points);
  const int width = view.matte.width_px();
  std::vector<Vector3d> at_mm = points.at_mm;
  std::vector<float> sd_mm = points.sd_mm;
  for_rows(view.matte.height_px(), 0, [&](int first, int last) {
    for (int pixel = first * width; pixel < last * width; ++pixel) {
      if (points.known[pixel] == 0) continue;
      const Neighbours::Corrected corrected = neighbours.corrected(pixel % width, pixel / width);
      at_mm[pixel] = corrected.at_mm, sd_mm[pixel] = static_cast<float>(corrected.sd_mm);
    }
  });
  points.at_mm = std::move(at_mm), points.sd_mm = std::move(sd_mm);
}

double shift_of_cut(double share) {
  constexpr double kNone = 1e-6;
  if (!(share > kNone)) return 0.0;
  share = std::min(share, 0.5);
  double low = 0.0, high = 5.0;  // of the cut, from the middle
  while (high - low > 1e-6) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(middle / std::numbers::sqrt2) > share ? low : high) = middle;
  }
  const double density = std::exp(-0.5 * low * low) * std::numbers::inv_sqrtpi / std::numbers::sqrt2;
  return density / (1.0 - share);
}

}  // namespace glasswing
