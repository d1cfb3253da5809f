#include "core/design/next_round.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "core/base/median.h"
#include "core/design/known_shape.h"
#include "core/design/shape_waves.h"

namespace glasswing {
namespace {

constexpr int kDirections = 8, kShapeDirections = 32;
constexpr double kNextPeriod = 1.25, kNextShapePeriod = 1.12;
constexpr double kBeyond = 4.0;  // a shape's longest period, over the monitor's longer side
constexpr double kAgain = 1.03;  // to the period of a wave that is chosen again
constexpr double kLeftOver = 1.0 / 30.0;
constexpr double kMaxWeightError = 0.3;  // of a weight, by its own standard error
constexpr double kMaxTurn = 0.8;  // radians of a wave: a less certain position may be mistaken for another

// As wide as the monitor's pixels make them.
Footprints through_pixels(Footprints modes) {
  for (Footprint& mode : modes) mode.xx_px2 += kFlatPixel_px2, mode.yy_px2 += kFlatPixel_px2;
  return modes;
}

ShapeKind kind_of(const KnownPixel& pixel) {
  double light = 0.0;
  for (const Footprint& mode : pixel.modes) light += mode.weight;
  return shape_kind(through_pixels(pixel.modes), pixel.excess * std::sqrt(pixel.noise.variance(0.5 * light)));
}

// C, for F and then (R, cx, cy, xx, xy, yy) of each mode.
Eigen::MatrixXd covariance_of(const PatternAnswers& shown, const KnownPixel& pixel, double excess) {
  const Eigen::MatrixXd by = whitened_slopes(shown, through_pixels(pixel.modes), pixel.noise);
  const double side_px = std::max(shown.extent().width_px, shown.extent().height_px);
  return (by.transpose() * by / (excess * excess) +
          prior_information(pixel.modes.size(), shown.extent(), side_px))
      .inverse();
}

// The index of a mode's cx in C.
constexpr Eigen::Index centre_of(int mode) {
  return 6 * mode + 2;
}

double centre_sd_px(const Eigen::MatrixXd& covariance, int mode) {
  return std::sqrt(0.5 * covariance.block<2, 2>(centre_of(mode), centre_of(mode)).trace());
}

// What is known about a pixel, and how much an error matters.
struct Known {
  Eigen::MatrixXd covariance;  // C
  Eigen::MatrixXd weight;      // M, with zeros for F

  double composite() const { return std::sqrt((covariance * weight).trace()); }
  double centre_px() const { return centre_sd_px(covariance, 0); }
  double of(RoundTarget::Kind kind) const {
    return kind == RoundTarget::Kind::kCentre ? centre_px() : composite();
  }
  // Whether the strongest footprint's position is known to within a fraction of the wave's period.
  bool suits(const DesignedWave& wave) const {
    const double phi_rad = wave.phi_deg * std::numbers::pi / 180.0;
    const Eigen::Vector2d along(std::cos(phi_rad), std::sin(phi_rad));
    const double variance = along.dot(covariance.block<2, 2>(centre_of(0), centre_of(0)) * along);
    return 2.0 * std::numbers::pi / wave.period_px * std::sqrt(variance) < kMaxTurn;
  }
};

Known known_of(const PatternAnswers& shown, const KnownPixel& pixel, const Background& background) {
  Known known{.covariance = covariance_of(shown, pixel, pixel.excess), .weight = {}};
  const Eigen::Index size = known.covariance.cols();
  known.weight = Eigen::MatrixXd::Zero(size, size);
  known.weight.bottomRightCorner(size - 1, size - 1) =
      background.weight_on_monitor(through_pixels(pixel.modes));
  return known;
}

PatternAnswers answers_of(const std::vector<DesignedWave>& waves, const MonitorExtent& extent) {
  std::vector<ShownPattern> patterns;
  for (const DesignedWave& wave : waves) add_phases(wave, patterns);
  return {std::move(patterns), extent};
}

// For both phases of a wave: B, and (1 + B C B')^-1 B C.
struct Update {
  Eigen::MatrixXd by_covariance, gain;
  Update(const Eigen::MatrixXd& covariance, const Eigen::Ref<const Eigen::MatrixXd>& by)
      : by_covariance(by * covariance) {
    const Eigen::Matrix2d inner = Eigen::Matrix2d::Identity() + by_covariance * by.transpose();
    gain = inner.inverse() * by_covariance;
  }
  // The reduction of the squared error.
  double lowers(const Known& known, RoundTarget::Kind kind) const {
    if (kind == RoundTarget::Kind::kComposite)
      return ((by_covariance * known.weight).array() * gain.array()).sum();
    return 0.5 *
           (by_covariance.middleCols(centre_of(0), 2).array() * gain.middleCols(centre_of(0), 2).array())
               .sum();
  }
};

// Pixels of any shape, by kind.
struct ShapeGroup {
  KnownShape shape;
  std::ptrdiff_t pixels = 0;
};
std::map<ShapeKind, ShapeGroup> shapes_of(const PatternAnswers& shown, std::span<const KnownPixel> pixels,
                                          std::span<const DesignedWave> waves) {
  std::vector<SeenFrequency> seen;
  std::map<ShapeKind, ShapeGroup> groups;
  for (const KnownPixel& pixel : pixels) {
    if (!pixel.any_shape) continue;
    if (seen.empty()) seen = seen_frequencies(shown.patterns());
    const ShapeKind kind = kind_of(pixel);
    const auto known = groups.find(kind);
    if (known == groups.end()) {
      groups.insert({kind, {.shape = KnownShape(kind, seen, waves), .pixels = 1}});
    } else {
      ++known->second.pixels;
    }
  }
  return groups;
}

}  // namespace

void find_excess(const PatternAnswers& shown, std::span<KnownPixel> pixels) {
  std::vector<double> found;
  std::vector<KnownPixel*> unknown;
  for (KnownPixel& pixel : pixels) {
    int best = -1;
    double least_px = std::numeric_limits<double>::infinity();
    for (int m = 0; m < pixel.modes.size(); ++m) {
      const double sd_px = pixel.centre_sd_px[m];
      // Modes that share their light are only known jointly.
      const bool alone = pixel.weight_sd[m] <= kMaxWeightError * pixel.modes[m].weight;
      if (alone && sd_px > 0.0 && sd_px < least_px) least_px = sd_px, best = m;
    }
    if (best < 0 || pixel.any_shape) {
      unknown.push_back(&pixel);
      continue;
    }
    pixel.excess = least_px / centre_sd_px(covariance_of(shown, pixel, 1.0), best);
    found.push_back(pixel.excess);
  }
  if (found.empty()) return;
  const double usual = median(std::move(found));
  for (KnownPixel* pixel : unknown) pixel->excess = usual;
}

std::vector<PixelError> errors_of(const PatternAnswers& shown, std::span<const KnownPixel> pixels) {
  const Background background(shown.extent());
  const std::map<ShapeKind, ShapeGroup> shapes =
      shapes_of(shown, pixels, usual_waves(shown.extent(), /*any_shape=*/true));
  std::vector<PixelError> errors;
  for (const KnownPixel& pixel : pixels) {
    const Known known = known_of(shown, pixel, background);
    const double composite =
        pixel.any_shape ? std::sqrt(shapes.at(kind_of(pixel)).shape.square()) : known.composite();
    errors.push_back({.composite = composite, .centre_px = known.centre_px()});
  }
  return errors;
}

std::vector<DesignedWave> usual_waves(const MonitorExtent& extent, bool any_shape) {
  const int directions = any_shape ? kShapeDirections : kDirections;
  const double finest_px = any_shape ? kFinestShape_px : kFinestPeriod_px,
               next = any_shape ? kNextShapePeriod : kNextPeriod;
  std::vector<DesignedWave> waves;
  for (int d = 0; d < directions; ++d) {
    const double longest_px = (any_shape ? kBeyond : 1.0) * std::max(extent.width_px, extent.height_px);
    for (double period_px = finest_px; period_px < longest_px; period_px *= next)
      waves.push_back(
          {.phi_deg = 180.0 * d / directions, .period_px = std::round(100.0 * period_px) / 100.0});
  }
  return waves;
}

std::vector<DesignedWave> choose_waves(const PatternAnswers& shown, std::span<const KnownPixel> pixels,
                                       const RoundTarget& target, std::vector<DesignedWave> waves, int least,
                                       int most) {
  std::vector<DesignedWave> chosen;
  const PatternAnswers answers = answers_of(waves, shown.extent());
  const Background background(shown.extent());
  std::vector<Known> known;
  std::vector<Eigen::MatrixXd> slopes;  // by pixel: two rows a wave
  std::map<ShapeKind, ShapeGroup> shapes = shapes_of(shown, pixels, waves);
  for (const KnownPixel& pixel : pixels) {
    if (pixel.any_shape) continue;
    known.push_back(known_of(shown, pixel, background));
    slopes.push_back(whitened_slopes(answers, pixel.modes, pixel.noise) / pixel.excess);
  }
  const double enough = target.error * target.error;
  const auto done = [&] {
    std::ptrdiff_t missing = std::ranges::count_if(
        known, [&](const Known& pixel) { return pixel.of(target.kind) > target.error; });
    for (const auto& [kind, group] : shapes) missing += group.shape.square() > enough ? group.pixels : 0;
    return static_cast<double>(missing) <= kLeftOver * static_cast<double>(pixels.size());
  };
  while (std::ssize(chosen) < most && (std::ssize(chosen) < least || !done())) {
    std::vector<double> before;
    for (const Known& pixel : known) before.push_back(std::pow(pixel.of(target.kind), 2));
    Eigen::ArrayXd of_shapes = Eigen::ArrayXd::Zero(std::ssize(waves));
    for (const auto& [kind, group] : shapes)
      of_shapes += static_cast<double>(group.pixels) * (group.shape.lowered() + enough).log();
    size_t best = 0;
    double lowest = std::numeric_limits<double>::infinity();
    for (size_t w = 0; w < waves.size(); ++w) {
      double sum = of_shapes[static_cast<Eigen::Index>(w)];
      for (size_t p = 0; p < known.size(); ++p) {
        const Known& pixel = known[p];
        if (!pixel.suits(waves[w])) {
          sum += std::log(before[p] + enough);
          continue;
        }
        const Update update(pixel.covariance, slopes[p].middleRows(2 * static_cast<Eigen::Index>(w), 2));
        const double left = before[p] - update.lowers(pixel, target.kind);
        sum += std::log(std::max(left, 0.0) + enough);
      }
      if (sum < lowest) lowest = sum, best = w;
    }
    for (size_t p = 0; p < known.size(); ++p) {
      if (!known[p].suits(waves[best])) continue;
      const Update update(known[p].covariance, slopes[p].middleRows(2 * static_cast<Eigen::Index>(best), 2));
      known[p].covariance -= update.by_covariance.transpose() * update.gain;
    }
    for (auto& [kind, group] : shapes) group.shape.show(static_cast<Eigen::Index>(best));
    chosen.push_back(waves[best]);
    waves[best].period_px = std::round(100.0 * kAgain * waves[best].period_px) / 100.0;
  }
  return chosen;
}

}  // namespace glasswing
