#include "core/footprint/matte_covariance.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "core/footprint/within_pixel.h"

namespace glasswing {
namespace {

constexpr double kSeen = 5.0;         // of a mode, in sigma_r
constexpr double kDifference = 0.01;  // of derivatives, in sigma_r
constexpr double kRidge = 1e-10;      // of N's diagonal
constexpr int kMaxSamples = 1 << 14;  // of a sweep, and pictures that are alike
constexpr int kMaxSweeps = 256, kMaxPictures = 4096;
constexpr double kMinBar_px = 0.5, kMaxOffset_px = 1e5;
// Of a pyramid's coefficient and of a neighbour that is 0, over the prior's standard deviation: less, as both
// are known to be positive. Held to brute force by tests/solver/any.
constexpr double kOwnPrior = 0.7, kAroundPrior = 0.1;
constexpr int kRounds = 4;  // of s and the weights of white and bars for it

}  // namespace

absl::StatusOr<MatteCovariance> MatteCovariance::create(const v1::MatteMetadata& metadata) {
  if (metadata.sweeps().empty()) {
    return absl::FailedPreconditionError(
        "the matte does not record how it was sampled, so the errors of its composites are not known; mattes "
        "from method gaussian do, if solved by this version or a later one and without the option images");
  }
  if (metadata.sweeps_size() > kMaxSweeps || metadata.lit_pictures_size() > kMaxPictures) {
    return absl::DataLossError(
        fmt::format("the matte's header names {} sweeps and {} pictures; {} and {} are accepted",
                    metadata.sweeps_size(), metadata.lit_pictures_size(), kMaxSweeps, kMaxPictures));
  }
  MatteCovariance covariance;
  for (const v1::Monitor& monitor : metadata.monitors()) covariance.extents_.push_back(extent_of(monitor));
  for (const v1::StripeSweep& sweep : metadata.sweeps()) {
    const double length_px = sweep.last_r_px() - sweep.first_r_px();
    if (sweep.texture() < 0 || sweep.texture() >= metadata.monitors_size() || !(sweep.sigma_px() > 0.0) ||
        !(length_px > 0.0) || !std::isfinite(length_px + sweep.sigma_px() + sweep.phi_deg()) ||
        sweep.count() < 2 || sweep.count() > kMaxSamples)
      return absl::DataLossError("the matte's header names an impossible sweep");
    const double phi = sweep.phi_deg() * std::numbers::pi / 180.0;
    covariance.sweeps_.push_back(
        {.texture = sweep.texture(),
         .axis = {.cos_phi = std::cos(phi), .sin_phi = std::sin(phi), .sigma_px = sweep.sigma_px()},
         .first_r_px = sweep.first_r_px(),
         .step_px = length_px / (sweep.count() - 1),
         .count = sweep.count()});
  }
  for (const v1::LitPicture& picture : metadata.lit_pictures()) {
    const bool bars = picture.bar_px() != 0.0;
    if (picture.texture() < 0 || picture.texture() >= metadata.monitors_size() ||
        (bars && !(picture.bar_px() >= kMinBar_px)) || !(std::abs(picture.offset_px()) < kMaxOffset_px) ||
        !(picture.light() > 0.0) || !(picture.light() <= 1.0) || picture.count() < 1 ||
        picture.count() > kMaxSamples)
      return absl::DataLossError("the matte's header names an impossible picture of white or bars");
    covariance.pictures_.push_back({.texture = picture.texture(),
                                    .lit = {.bars = bars,
                                            .horizontal = picture.horizontal(),
                                            .bar_px = picture.bar_px(),
                                            .offset_px = picture.offset_px(),
                                            .inverse = picture.inverse()},
                                    .light = picture.light(),
                                    .count = picture.count()});
  }
  return covariance;
}

void MatteCovariance::set_derivatives(const Footprint& mode, const Sweep& sweep, int begin, int end,
                                      Eigen::Ref<Eigen::MatrixXd> by) const {
  const MonitorExtent& extent = extents_[sweep.texture];
  const double variance = answered_variance(mode, sweep.axis), step = kDifference * std::sqrt(variance),
               square = kDifference * variance;
  const auto fill = [&](int parameter, double Footprint::*value, double by_px) {
    Footprint less = mode, more = mode;
    less.*value -= by_px;
    more.*value += by_px;
    for (int i = begin; i < end; ++i) {
      const double r_px = sweep.first_r_px + i * sweep.step_px;
      by(i - begin, parameter) =
          (response(more, sweep.axis, r_px, extent) - response(less, sweep.axis, r_px, extent)) /
          (2.0 * by_px);
    }
  };
  fill(0, &Footprint::weight, 0.5 * mode.weight);
  fill(1, &Footprint::x_px, step);
  fill(2, &Footprint::y_px, step);
  fill(3, &Footprint::xx_px2, square);
  fill(4, &Footprint::xy_px2, square);
  fill(5, &Footprint::yy_px2, square);
}

Eigen::MatrixXd MatteCovariance::of_sweeps(std::span<const Used> modes) const {
  const Eigen::Index size = 1 + 6 * std::ssize(modes);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  information(0, 0) = 1.0;  // black
  for (const Sweep& sweep : sweeps_) {
    struct Seen {
      const Used* used;
      int begin, end;  // samples
    };
    std::vector<Seen> seen;
    int begin = sweep.count, end = 0;
    for (const Used& used : modes) {
      if (used.texture != sweep.texture) continue;
      const Footprint& mode = used.mode;
      const double at = mode.x_px * sweep.axis.cos_phi + mode.y_px * sweep.axis.sin_phi - sweep.first_r_px,
                   reach = kSeen * std::sqrt(answered_variance(mode, sweep.axis));
      const auto sample = [&](double r_px) {
        const double count = sweep.count;
        return static_cast<int>(std::clamp(std::ceil(r_px / sweep.step_px), 0.0, count));
      };
      const Seen own{&used, sample(at - reach), sample(at + reach)};
      if (own.begin == own.end) continue;
      begin = std::min(begin, own.begin), end = std::max(end, own.end);
      seen.push_back(own);
    }
    Eigen::MatrixXd by = Eigen::MatrixXd::Zero(std::max(end - begin, 0), size);
    by.col(0).setOnes();
    for (const Seen& own : seen) {
      set_derivatives(own.used->mode, sweep, own.begin, own.end,
                      by.block(own.begin - begin, own.used->column, own.end - own.begin, 6));
    }
    information(0, 0) += static_cast<double>(sweep.count - by.rows());
    information.noalias() += by.transpose() * by;
  }
  return information;
}

namespace {

// The places whose light the samples may confuse with the pyramid's: its own and those around, of weight 1,
// with their prior standard deviations.
struct Unsure {
  std::vector<Footprint> places;
  std::vector<double> prior_sd, weight;
  Eigen::Index first_mode = 0;  // from here on they are modes that are kept
};

Unsure unsure_of(const PyramidFootprint& pyramid, std::span<const Mode> modes, const MonitorExtent& extent) {
  std::map<std::array<int, 3>, double> weights;
  for (const Coefficient& own : pyramid.coefficients) {
    if (own.level >= kPyramidLevels) continue;
    const double step_px = std::ldexp(2.0, own.level);
    for (int row = own.row - 1; row <= own.row + 1; ++row) {
      for (int column = own.column - 1; column <= own.column + 1; ++column) {
        if (row < 0 || column < 0 || row * step_px >= extent.height_px || column * step_px >= extent.width_px)
          continue;
        weights.try_emplace({own.level, row, column});
      }
    }
    weights[{own.level, own.row, own.column}] = own.weight;
  }
  Unsure all;
  for (const auto& [place, weight] : weights) {
    all.places.push_back(footprint_of(
        mode_of({.level = place[0], .column = place[2], .row = place[1], .weight = 1.0f}, pyramid.texture)));
    all.prior_sd.push_back((weight > 0.0 ? kOwnPrior : kAroundPrior) *
                           std::ldexp(static_cast<double>(pyramid.prior_sd), 2 * place[0]));
    all.weight.push_back(weight);
  }
  all.first_mode = std::ssize(all.places);
  for (const Coefficient& kept : pyramid.coefficients) {
    if (kept.level < kPyramidLevels) continue;
    all.places.push_back(footprint_of(modes[static_cast<size_t>(kept.level - kPyramidLevels)]));
    all.places.back().weight = 1.0;
    all.prior_sd.push_back(1.0);
    all.weight.push_back(kept.weight);
  }
  return all;
}

// Of the average of a pyramid and the pixel's modes (solver/any/pyramid_fit.h): how far they are apart.
// `light`: of each place.
double variance_between(const Unsure& unsure, const Eigen::Ref<const Eigen::VectorXd>& light) {
  double weight = 0.0, seen = 0.0, of_modes = 0.0, seen_of_modes = 0.0;
  for (Eigen::Index k = 0; k < light.size(); ++k) {
    const bool is_mode = k >= unsure.first_mode;
    const double own = unsure.weight[k];
    (is_mode ? of_modes : weight) += own;
    (is_mode ? seen_of_modes : seen) += own * light[k];
  }
  if (!(weight > 0.0) || !(of_modes > 0.0)) return 0.0;
  return weight * of_modes * std::pow(seen / weight - seen_of_modes / of_modes, 2);
}

}  // namespace

double MatteCovariance::variance(const PyramidFootprint& pyramid, std::span<const Mode> modes,
                                 absl::FunctionRef<double(const Footprint&)> light) const {
  const Unsure unsure = unsure_of(pyramid, modes, extents_[pyramid.texture]);
  const std::vector<Footprint>& places = unsure.places;
  const MonitorExtent& extent = extents_[pyramid.texture];
  const Eigen::Index count = std::ssize(places);
  const double noise = std::pow(static_cast<double>(pyramid.noise_sd), 2);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(count + 1, count + 1);
  information(0, 0) = 1.0 / noise;  // black
  for (const Sweep& sweep : sweeps_) {
    if (sweep.texture != pyramid.texture) continue;
    Eigen::MatrixXd by = Eigen::MatrixXd::Zero(sweep.count, count + 1);
    by.col(0).setOnes();
    for (Eigen::Index k = 0; k < count; ++k) {
      for (Eigen::Index i = 0; i < sweep.count; ++i) {
        const double r_px = sweep.first_r_px + static_cast<double>(i) * sweep.step_px;
        by(i, k + 1) = response(places[k], sweep.axis, r_px, extent);
      }
    }
    information.noalias() += by.transpose() * by / noise;
  }
  std::vector<LitShare> shares;
  for (const Footprint& place : places) shares.emplace_back(place, extent);
  for (const Picture& picture : pictures_) {
    if (picture.texture != pyramid.texture) continue;
    Eigen::VectorXd by(count + 1);
    by[0] = 1.0;
    double seen = 0.0;
    for (Eigen::Index k = 0; k < count; ++k) {
      by[k + 1] = picture.light * shares[k].of(picture.lit).share;
      seen += by[k + 1] * unsure.weight[k];
    }
    const double error = (picture.lit.bars ? kBarsError : kWhiteError) * seen;
    information.noalias() += by * by.transpose() / (noise / picture.count + error * error);
  }
  Eigen::VectorXd by(count + 1);
  by[0] = 1.0;
  for (Eigen::Index k = 0; k < count; ++k) {
    information(k + 1, k + 1) += std::pow(unsure.prior_sd[k], -2);
    by[k + 1] = light(places[k]);
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(information);
  if (factor.info() != Eigen::Success) return INFINITY;
  return by.dot(factor.solve(by)) + variance_between(unsure, by.tail(count));
}

std::vector<MatteCovariance::Shown> MatteCovariance::shown(std::span<const Used> modes) const {
  std::vector<LitShare> shares;
  for (const Used& used : modes) shares.emplace_back(used.mode, extents_[used.texture]);
  std::vector<Shown> all;
  for (const Picture& picture : pictures_) {
    Shown& own = all.emplace_back();
    own.by = Eigen::VectorXd::Zero(1 + 6 * std::ssize(modes));
    own.by[0] = 1.0 / picture.light;
    own.noise = 1.0 / (picture.light * picture.light * picture.count);
    double seen = 0.0;
    for (size_t m = 0; m < modes.size(); ++m) {
      const Used& used = modes[m];
      if (used.texture != picture.texture) continue;
      const NormalShare share = shares[m].of(picture.lit);
      const double weight = used.mode.weight;
      own.by.segment<6>(used.column) << share.share, weight * share.by_x, weight * share.by_y,
          weight * share.by_xx, weight * share.by_xy, weight * share.by_yy;
      seen += weight * share.share;
      own.error += weight * lit_share_error(used.mode, picture.lit, extents_[used.texture]);
    }
    own.error += (picture.lit.bars ? kBarsError : kWhiteError) * seen;
  }
  return all;
}

Eigen::MatrixXd MatteCovariance::root(std::span<const Mode> modes) const {
  std::vector<Used> used;
  size_t strongest = 0;
  double weight_sd = 0.0;
  for (const Mode& mode : modes) {
    if (mode.weight <= 0.0f) continue;
    used.push_back({.mode = footprint_of(mode),
                    .texture = mode.texture,
                    .column = 1 + 6 * static_cast<Eigen::Index>(used.size())});
    if (used.size() > 1 && used.back().mode.weight <= used[strongest].mode.weight) continue;
    strongest = used.size() - 1;
    weight_sd = static_cast<double>(mode.weight_sd);
  }
  if (!(weight_sd > 0.0)) return {};
  const Eigen::MatrixXd sweeps = of_sweeps(used);
  const std::vector<Shown> pictures = shown(used);
  const Eigen::Index size = sweeps.rows();
  // In units of each parameter's own information, so that N is as well conditioned as it can be.
  const Eigen::VectorXd unit = sweeps.diagonal().cwiseSqrt().cwiseInverse();
  if (!unit.allFinite()) return {};
  const Eigen::VectorXd of_strongest = Eigen::VectorXd::Unit(size, used[strongest].column);
  double s = weight_sd;
  Eigen::MatrixXd n, m;
  Eigen::LLT<Eigen::MatrixXd> factor;
  for (int round = 0; round < kRounds; ++round) {
    n = m = sweeps;
    for (const Shown& picture : pictures) {
      const double weight = s * s / (s * s * picture.noise + picture.error * picture.error);
      n.noalias() += weight * picture.by * picture.by.transpose();
      m.noalias() += weight * weight * picture.noise * picture.by * picture.by.transpose();
    }
    for (const Used& own : used) {
      const std::array<double, 5> known = known_within_pixel(own.mode);
      for (Eigen::Index i = 0; i < 5; ++i) {
        const Eigen::Index at = own.column + 1 + i;
        n(at, at) += s * s * known[i];
        m(at, at) += s * s * known[i];
      }
    }
    Eigen::MatrixXd scaled = unit.asDiagonal() * n * unit.asDiagonal();
    scaled.diagonal().array() += kRidge;
    factor.compute(scaled);
    if (factor.info() != Eigen::Success) return {};
    const double variance = of_strongest.dot(factor.solve(of_strongest));
    s = weight_sd / (std::sqrt(variance) * unit[used[strongest].column]);
  }
  const Eigen::LLT<Eigen::MatrixXd> noise(m);
  if (noise.info() != Eigen::Success) return {};
  const Eigen::MatrixXd root_of_m = noise.matrixL();
  return s * (unit.asDiagonal() * factor.solve(unit.asDiagonal() * root_of_m));
}

}  // namespace glasswing
