#include "solver/background/image_registration.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/image/image_file.h"

namespace glasswing {
namespace {

constexpr int kMotions = 6, kUnknowns = 12, kColumns = 8;  // in total; kColumns: of one channel
constexpr double kMaxShift = 0.02;                         // of the longer side
constexpr double kMaxGain = 1.4;
constexpr double kMaxRest = 0.05;             // above the noise of a photograph
constexpr int kCoarsest_px = 160;             // longer side
constexpr double kMaxLevelSamples = 100'000;  // of a level
constexpr double kMinSd = 0.1 / 255.0;
constexpr double kBlur_px = 1.0;  // suppresses the slopes of noise
constexpr double kAlike =
    4.0 * std::numbers::pi * kBlur_px * kBlur_px;  // samples that share noise after the blur

using Step = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

struct Point {
  double x = 0.0, y = 0.0;
};

// Weights of four neighbours at fraction t of the way from the second to the third (Catmull-Rom).
std::array<double, 4> cubic(double t) {
  return {((-0.5 * t + 1.0) * t - 0.5) * t, (1.5 * t - 2.5) * t * t + 1.0, ((-1.5 * t + 2.0) * t + 0.5) * t,
          (0.5 * t - 0.5) * t * t};
}

// At a position in px, pixel centres at +0.5; false: outside the picture.
bool sample_at(const RadianceImage& image, Point place, std::array<double, 3>& value) {
  if (!(place.x >= 0.0 && place.y >= 0.0 && place.x <= image.width_px && place.y <= image.height_px))
    return false;
  const double x = place.x - 0.5, y = place.y - 0.5;
  const double left = std::floor(x), top = std::floor(y);
  const std::array<double, 4> across = cubic(x - left), down = cubic(y - top);
  value = {};
  for (int j = 0; j < 4; ++j) {
    const int v = std::clamp(static_cast<int>(top) + j - 1, 0, image.height_px - 1);
    for (int i = 0; i < 4; ++i) {
      const int u = std::clamp(static_cast<int>(left) + i - 1, 0, image.width_px - 1);
      const double weight = across[i] * down[j];
      const float* const code = &image.samples[image.index(u, v, 0)];
      for (size_t c = 0; c < 3; ++c) value[c] += weight * code[c];
    }
  }
  return true;
}

RadianceImage shares_of(const Image16& codes) {
  RadianceImage image(codes.width_px, codes.height_px);
  std::transform(codes.samples.begin(), codes.samples.end(), image.samples.begin(), radiance_of);
  return image;
}

Point moved_point(const ImageRegistration& registration, Point p) {
  return {p.x + registration.shift_px[0] + registration.stretch[0] * p.x + registration.stretch[1] * p.y,
          p.y + registration.shift_px[1] + registration.stretch[2] * p.x + registration.stretch[3] * p.y};
}

// 0 of none.
// The standard deviation of normal values from the median of their absolute values.
double robust_sd(std::vector<double> differences) {
  for (double& difference : differences) difference = std::abs(difference);
  return std::max(1.4826 * median(std::move(differences)), kMinSd);
}

// Both pictures at the same scale.
class Level {
 public:
  Level(const RadianceImage& with, const RadianceImage& without, double scale)
      : full_width_px_(with.width_px),
        full_height_px_(with.height_px),
        with_(shrunk(with, scale)),
        without_(shrunk(without, scale)),
        x_scale_(1.0 * with_.width_px / with.width_px),
        y_scale_(1.0 * with_.height_px / with.height_px),
        stride_(std::max(
            1, static_cast<int>(std::sqrt(1.0 * with_.width_px * with_.height_px / kMaxLevelSamples)))) {}

  // One step of Gauss-Newton, for light alone or with motion. Returns how far it moves a corner, in px of
  // this level.
  double step(ImageRegistration& registration, bool moves_too) {
    look(registration);
    Normal normal = prior();
    Step gradient = -normal * unknowns(registration);
    for (size_t c = 0; c < 3; ++c) add_channel(c, registration, normal, gradient);
    if (!moves_too) {
      normal.topRows<kMotions>().setZero();
      normal.leftCols<kMotions>().setZero();
      normal.topLeftCorner<kMotions, kMotions>().setIdentity();
      gradient.head<kMotions>().setZero();
    }
    const Step change = normal.ldlt().solve(gradient);
    ImageRegistration moves;
    for (int i = 0; i < 2; ++i) moves.shift_px[i] = change[i];
    for (int i = 0; i < 4; ++i) moves.stretch[i] = change[2 + i] / half_px();
    for (size_t i = 0; i < 2; ++i) registration.shift_px[i] += moves.shift_px[i];
    for (size_t i = 0; i < 4; ++i) registration.stretch[i] += moves.stretch[i];
    for (size_t c = 0; c < 3; ++c) {
      registration.gain[c] += change[kMotions + 2 * static_cast<int>(c)];
      registration.offset[c] += change[kMotions + 2 * static_cast<int>(c) + 1];
    }
    return moves.max_px(full_width_px_, full_height_px_) * x_scale_;
  }

  // The sum of the channels' standard deviations of the residual where the picture is steep.
  double steep_rest(const ImageRegistration& registration) {
    look(registration);
    return sd_[0] + sd_[1] + sd_[2];
  }
  // The standard deviation of the whole residual in the worst channel.
  double rest(const ImageRegistration& registration) {
    look(registration);
    double most = 0.0;
    for (size_t c = 0; c < 3; ++c) most = std::max(most, robust_sd(differences_of(c, -1.0)));
    return most;
  }

 private:
  struct Seen {
    std::array<double, 3> without{}, difference{}, x_slope{},
        y_slope{};  // slopes per px of the whole picture
    Point p;        // px of the whole picture, from its middle

    double steepness(size_t c) const { return x_slope[c] * x_slope[c] + y_slope[c] * y_slope[c]; }
  };

  // Blurred too: interpolation reduces noise, which would bias the fit towards positions between pixels.
  static RadianceImage shrunk(const RadianceImage& image, double scale) {
    RadianceImage small = resized(image, std::max(1, static_cast<int>(std::lround(image.width_px * scale))),
                                  std::max(1, static_cast<int>(std::lround(image.height_px * scale))));
    cv::Mat samples(small.height_px, small.width_px, CV_32FC3, small.samples.data());
    cv::GaussianBlur(samples, samples, {}, kBlur_px);
    return small;
  }
  double half_px() const { return 0.5 * std::max(full_width_px_, full_height_px_); }

  // Prior standard deviations: without texture the pictures do not determine a shift, and it stays 0.
  Normal prior() const {
    Step sd;
    sd.head<kMotions>().setConstant(kMaxShift * half_px());
    for (int c = 0; c < 3; ++c) sd.segment<2>(kMotions + 2 * c) << 0.1, 0.1;
    return sd.cwiseAbs2().cwiseInverse().asDiagonal();
  }
  Step unknowns(const ImageRegistration& registration) const {
    Step all;
    for (int i = 0; i < 2; ++i) all[i] = registration.shift_px[i];
    for (int i = 0; i < 4; ++i) all[2 + i] = registration.stretch[i] * half_px();
    for (int c = 0; c < 3; ++c) {
      all[kMotions + 2 * c] = registration.gain[c] - 1.0;
      all[kMotions + 2 * c + 1] = registration.offset[c];
    }
    return all;
  }

  void look(const ImageRegistration& registration) {
    seen_.clear();
    for (int y = stride_ / 2; y < with_.height_px; y += stride_) {
      for (int x = stride_ / 2; x < with_.width_px; x += stride_) {
        Seen seen;
        seen.p = {(x + 0.5) / x_scale_ - 0.5 * full_width_px_, (y + 0.5) / y_scale_ - 0.5 * full_height_px_};
        const Point to = moved_point(registration, seen.p);
        const Point from = {(to.x + 0.5 * full_width_px_) * x_scale_,
                            (to.y + 0.5 * full_height_px_) * y_scale_};
        if (!sample_at(without_, from, seen.without)) continue;
        for (int c = 0; c < 3; ++c) {
          const size_t i = c;
          seen.difference[i] =
              with_.at(x, y, c) - registration.gain[i] * seen.without[i] - registration.offset[i];
          seen.x_slope[i] = 0.5 * x_scale_ * (with(x + 1, y, c) - with(x - 1, y, c));
          seen.y_slope[i] = 0.5 * y_scale_ * (with(x, y + 1, c) - with(x, y - 1, c));
        }
        seen_.push_back(seen);
      }
    }
    for (size_t c = 0; c < 3; ++c) sd_[c] = robust_sd(differences_of(c, median_steepness(c)));
  }

  double with(int x, int y, int c) const {
    return static_cast<double>(
        with_.at(std::clamp(x, 0, with_.width_px - 1), std::clamp(y, 0, with_.height_px - 1), c));
  }
  double median_steepness(size_t c) const {
    std::vector<double> all;
    all.reserve(seen_.size());
    for (const Seen& seen : seen_) all.push_back(seen.steepness(c));
    return median(std::move(all));
  }
  // Uses only samples steeper than this, if there are any: dark or uniform areas agree under any motion.
  std::vector<double> differences_of(size_t c, double steepness) const {
    std::vector<double> differences;
    for (const Seen& seen : seen_) {
      if (seen.steepness(c) > steepness) differences.push_back(seen.difference[c]);
    }
    return differences.empty() && steepness >= 0.0 ? differences_of(c, -1.0) : differences;
  }

  // Slopes come from the picture with the object at its own pixels, where their noise is independent of the
  // difference's. Interpolated slopes of the other picture have less noise between pixels, which would bias
  // the fit towards those. For the same reason the gain's column is the mean of both pictures.
  void add_channel(size_t c, const ImageRegistration& registration, Normal& normal, Step& gradient) const {
    Eigen::Matrix<double, kColumns, kColumns> squares = Eigen::Matrix<double, kColumns, kColumns>::Zero();
    Eigen::Matrix<double, kColumns, 1> products = Eigen::Matrix<double, kColumns, 1>::Zero(), column;
    for (const Seen& seen : seen_) {
      const double x_slope = seen.x_slope[c], y_slope = seen.y_slope[c];
      const double u = seen.p.x / half_px(), v = seen.p.y / half_px();
      const double code = seen.without[c] + 0.5 * seen.difference[c] / registration.gain[c];
      column << x_slope, y_slope, x_slope * u, x_slope * v, y_slope * u, y_slope * v, code, 1.0;
      const double z = seen.difference[c] / (3.0 * sd_[c]), belief = 1.0 / (1.0 + z * z);
      const double weight = belief * belief / (kAlike * sd_[c] * sd_[c]);
      squares.noalias() += (weight * column) * column.transpose();
      products.noalias() += (weight * seen.difference[c]) * column;
    }
    const auto place = [c](int i) { return i < kMotions ? i : i + 2 * static_cast<int>(c); };
    for (int i = 0; i < kColumns; ++i) {
      gradient[place(i)] += products[i];
      for (int j = 0; j < kColumns; ++j) normal(place(i), place(j)) += squares(i, j);
    }
  }

  const int full_width_px_, full_height_px_;
  const RadianceImage with_, without_;
  const double x_scale_, y_scale_;
  const int stride_;
  std::vector<Seen> seen_;
  std::array<double, 3> sd_{};
};

absl::Status check_small(const ImageRegistration& registration, double rest, int width_px, int height_px) {
  const double max_px = registration.max_px(width_px, height_px),
               allowed_px = kMaxShift * std::max(width_px, height_px);
  if (!(max_px <= allowed_px)) {
    return absl::FailedPreconditionError(fmt::format(
        "the pictures are shifted by {:.1f} px; at most {:.1f} px can be drift: the camera must not be moved",
        max_px, allowed_px));
  }
  for (const double gain : registration.gain) {
    if (!(gain <= kMaxGain && gain >= 1.0 / kMaxGain)) {
      return absl::FailedPreconditionError(
          fmt::format("one picture is {:.2f} times as bright as the other; it must be between {:.2f} and "
                      "{:.2f}: exposure and "
                      "light must be the same",
                      gain, 1.0 / kMaxGain, kMaxGain));
    }
  }
  if (rest <= kMaxRest) return absl::OkStatus();
  return absl::FailedPreconditionError(
      fmt::format("the pictures differ by {:.0f} % of full scale in most of their pixels; at most {:.0f} % "
                  "can be noise: both must show the same stage, and more of it than of the object",
                  100.0 * rest, 100.0 * kMaxRest));
}

}  // namespace

double ImageRegistration::max_px(int width_px, int height_px) const {
  double most = 0.0;
  for (const double x : {-0.5 * width_px, 0.5 * width_px}) {
    for (const double y : {-0.5 * height_px, 0.5 * height_px}) {
      const Point to = moved_point(*this, {x, y});
      most = std::max(most, std::hypot(to.x - x, to.y - y));
    }
  }
  return most;
}

absl::Status check_same_size(const Image16& with, const Image16& without) {
  if (with.width_px == without.width_px && with.height_px == without.height_px) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("the picture with the object is {}x{}, the one without {}x{}; they must have the same size",
                  with.width_px, with.height_px, without.width_px, without.height_px));
}

absl::StatusOr<ImageRegistration> find_registration(const Image16& with, const Image16& without) {
  constexpr int kMaxSteps = 20;
  constexpr int kLightSteps = 8;  // linear fit with robust weights
  constexpr double kConverged_px = 0.005;
  // Interpolating noise alone removes up to 1 % of a difference, and chance a few thousandths.
  constexpr double kWorthMoving = 0.98;
  GW_RETURN_IF_ERROR(check_same_size(with, without));
  const RadianceImage object = shares_of(with), empty = shares_of(without);
  const double side_px = std::max(with.width_px, with.height_px);
  const int halvings = std::max(0, static_cast<int>(std::ceil(std::log2(side_px / kCoarsest_px))));
  ImageRegistration registration;
  for (int i = halvings; i > 0; --i) {
    Level level(object, empty, std::exp2(-i));
    for (int step = 0; step < kMaxSteps && level.step(registration, true) > kConverged_px; ++step) {
    }
  }
  Level whole(object, empty, 1.0);
  for (int step = 0; step < kMaxSteps && whole.step(registration, true) > kConverged_px; ++step) {
  }
  ImageRegistration still;
  for (int step = 0; step < kLightSteps; ++step) whole.step(still, false);
  if (whole.steep_rest(registration) > kWorthMoving * whole.steep_rest(still)) registration = still;
  GW_RETURN_IF_ERROR(check_small(registration, whole.rest(registration), with.width_px, with.height_px));
  return registration;
}

RadianceImage moved(const Image16& without, const ImageRegistration& registration) {
  const RadianceImage empty = shares_of(without);
  RadianceImage image(empty.width_px, empty.height_px);
  const double middle_x = 0.5 * image.width_px, middle_y = 0.5 * image.height_px;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const Point to = moved_point(registration, {x + 0.5 - middle_x, y + 0.5 - middle_y});
      std::array<double, 3> value{};
      const bool seen = sample_at(empty, {to.x + middle_x, to.y + middle_y}, value);
      for (size_t c = 0; c < 3; ++c) {
        image.at(x, y, static_cast<int>(c)) =
            seen ? static_cast<float>(registration.gain[c] * value[c] + registration.offset[c])
                 : std::numeric_limits<float>::quiet_NaN();
      }
    }
  }
  return image;
}

}  // namespace glasswing
