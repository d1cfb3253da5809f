#include "core/footprint/matte_covariance.h"

#include <absl/status/status.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "core/base/status.h"
#include "core/footprint/positive_set.h"
#include "core/footprint/within_pixel.h"

namespace glasswing {
namespace {

constexpr double kSeen = 5.0;         // of a mode, in sigma_r
constexpr double kDifference = 0.01;  // of derivatives, in sigma_r
constexpr double kRidge = 1e-10;      // of N's diagonal
constexpr int kMaxSamples = 1 << 14;  // of a sweep, and pictures that are alike
constexpr int kMaxSweeps = 256, kMaxPictures = 4096;
constexpr double kMinBar_px = 0.5, kMaxOffset_px = 1e5;
constexpr double kMaxFrequency = 0.5001, kMaxPhase_deg = 1e6;  // of sinusoids
constexpr Eigen::Index kDraws = 32;  // of a pyramid's coefficients: its error is known to an eighth
constexpr int kRounds = 4;           // of s and the weights of white and bars for it

}  // namespace

v1::LitPicture lit_picture(int texture, const LitArea& lit, double light, int count) {
  v1::LitPicture named;
  named.set_texture(texture);
  named.set_bar_px(lit.bars ? lit.bar_px : 0.0);
  named.set_horizontal(lit.horizontal);
  named.set_offset_px(lit.offset_px);
  named.set_inverse(lit.inverse);
  named.set_light(light);
  named.set_count(count);
  return named;
}

absl::StatusOr<MatteCovariance> MatteCovariance::create(const v1::MatteMetadata& metadata) {
  const v1::Mixture& mixture = metadata.mixture();
  if (metadata.sweeps().empty() && mixture.sweeps().empty() && mixture.wave_sets().empty()) {
    return absl::FailedPreconditionError(
        "the matte does not record how it was sampled, so the errors of its composites are not known; mattes "
        "from method gaussian do, if solved by this version or a later one and without the option images");
  }
  if (metadata.sweeps_size() > kMaxSweeps || mixture.sweeps_size() > kMaxPictures ||
      metadata.lit_pictures_size() > kMaxPictures) {
    return absl::DataLossError(
        fmt::format("the matte's header names {} sweeps and {} pictures; {} and {} are accepted",
                    metadata.sweeps_size() + mixture.sweeps_size(), metadata.lit_pictures_size(), kMaxSweeps,
                    kMaxPictures));
  }
  MatteCovariance covariance;
  for (const v1::Monitor& monitor : metadata.monitors()) covariance.extents_.push_back(extent_of(monitor));
  for (const v1::StripeSweep& sweep : metadata.sweeps()) GW_RETURN_IF_ERROR(covariance.add_sweep(sweep));
  for (const v1::StripeSweep& sweep : mixture.sweeps()) GW_RETURN_IF_ERROR(covariance.add_sweep(sweep));
  GW_RETURN_IF_ERROR(covariance.add_waves(mixture));
  for (const v1::LitPicture& picture : metadata.lit_pictures())
    GW_RETURN_IF_ERROR(covariance.add_picture(picture));
  return covariance;
}

absl::Status MatteCovariance::add_sweep(const v1::StripeSweep& sweep) {
  const double length_px = sweep.last_r_px() - sweep.first_r_px();
  if (sweep.texture() < 0 || sweep.texture() >= std::ssize(extents_) || !(sweep.sigma_px() > 0.0) ||
      sweep.count() < 1 || sweep.count() > kMaxSamples ||
      !(sweep.count() == 1 ? length_px == 0.0 : length_px > 0.0) ||
      !std::isfinite(length_px + sweep.sigma_px() + sweep.phi_deg()) || !(sweep.light() >= 0.0) ||
      !(sweep.light() <= 1.0))
    return absl::DataLossError("the matte's header names an impossible sweep");
  const double phi = sweep.phi_deg() * std::numbers::pi / 180.0;
  sweeps_.push_back(
      {.texture = sweep.texture(),
       .axis = {.cos_phi = std::cos(phi), .sin_phi = std::sin(phi), .sigma_px = sweep.sigma_px()},
       .first_r_px = sweep.first_r_px(),
       .step_px = sweep.count() == 1 ? sweep.sigma_px() : length_px / (sweep.count() - 1),
       .count = sweep.count(),
       .light = sweep.light() == 0.0 ? 1.0 : sweep.light()});
  return absl::OkStatus();
}

absl::Status MatteCovariance::add_waves(const v1::Mixture& mixture) {
  struct Added {
    std::vector<ShownPattern> patterns;
    std::vector<double> light, root;
  };
  std::map<int, Added> by_texture;
  std::int64_t samples = 0;
  for (const v1::WaveSet& set : mixture.wave_sets()) {
    samples += std::int64_t{set.phase_deg_size()} * set.x_per_px_size();
    if (set.texture() < 0 || set.texture() >= std::ssize(extents_) || set.phase_deg().empty() ||
        set.x_per_px().empty() || set.x_per_px_size() != set.y_per_px_size() || !(set.light() > 0.0) ||
        !(set.light() <= 1.0) || set.count() < 1 || set.count() > kMaxSamples || samples > kMaxSamples)
      return absl::DataLossError("the matte's header names impossible sinusoids");
    Added& added = by_texture[set.texture()];
    for (int i = 0; i < set.x_per_px_size(); ++i) {
      for (const double phase_deg : set.phase_deg()) {
        const double fx = set.x_per_px(i), fy = set.y_per_px(i);
        if (!(std::hypot(fx, fy) > 0.0) || !(std::hypot(fx, fy) <= kMaxFrequency) ||
            !(std::abs(phase_deg) <= kMaxPhase_deg))
          return absl::DataLossError("the matte's header names an impossible sinusoid");
        ShownPattern& wave = added.patterns.emplace_back();
        wave.kind = ShownPattern::Kind::kWave;
        wave.fx = fx, wave.fy = fy;
        wave.phase_rad = phase_deg * std::numbers::pi / 180.0;
        added.light.push_back(set.light());
        added.root.push_back(std::sqrt(set.count()));
      }
    }
  }
  for (auto& [texture, added] : by_texture) {
    const Eigen::Index count = std::ssize(added.patterns);
    waves_.emplace(texture, Waves{.answers = {std::move(added.patterns), extents_[texture]},
                                  .light = Eigen::Map<const Eigen::VectorXd>(added.light.data(), count),
                                  .root = Eigen::Map<const Eigen::VectorXd>(added.root.data(), count)});
  }
  return absl::OkStatus();
}

absl::Status MatteCovariance::add_picture(const v1::LitPicture& picture) {
  const bool bars = picture.bar_px() != 0.0;
  if (picture.texture() < 0 || picture.texture() >= std::ssize(extents_) ||
      (bars && !(picture.bar_px() >= kMinBar_px)) || !(std::abs(picture.offset_px()) < kMaxOffset_px) ||
      !(picture.light() > 0.0) || !(picture.light() <= 1.0) || picture.count() < 1 ||
      picture.count() > kMaxSamples)
    return absl::DataLossError("the matte's header names an impossible picture of white or bars");
  pictures_.push_back({.texture = picture.texture(),
                       .lit = {.bars = bars,
                               .horizontal = picture.horizontal(),
                               .bar_px = picture.bar_px(),
                               .offset_px = picture.offset_px(),
                               .inverse = picture.inverse()},
                       .light = picture.light(),
                       .count = picture.count()});
  return absl::OkStatus();
}

std::pair<int, int> MatteCovariance::seen_samples(const Footprint& mode, const Sweep& sweep) {
  const double at = mode.x_px * sweep.axis.cos_phi + mode.y_px * sweep.axis.sin_phi - sweep.first_r_px,
               reach = kSeen * std::sqrt(answered_variance(mode, sweep.axis));
  const auto sample = [&](double r_px) {
    const double count = sweep.count;
    return static_cast<int>(std::clamp(std::ceil(r_px / sweep.step_px), 0.0, count));
  };
  return {sample(at - reach), sample(at + reach)};
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
          sweep.light *
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

Eigen::MatrixXd MatteCovariance::information_of(std::span<const Used> modes) const {
  const Eigen::Index size = 1 + 6 * std::ssize(modes);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(size, size);
  information(0, 0) = 1.0;  // black
  for (const Sweep& sweep : sweeps_) add_sweep_information(modes, sweep, information);
  for (const auto& [texture, waves] : waves_) add_wave_information(modes, texture, information);
  return information;
}

void MatteCovariance::add_sweep_information(std::span<const Used> modes, const Sweep& sweep,
                                            Eigen::MatrixXd& information) const {
  struct Seen {
    const Used* used;
    int begin, end;  // samples
  };
  std::vector<Seen> seen;
  int begin = sweep.count, end = 0;
  for (const Used& used : modes) {
    if (used.texture != sweep.texture) continue;
    const auto [first, last] = seen_samples(used.mode, sweep);
    const Seen own{&used, first, last};
    if (own.begin == own.end) continue;
    begin = std::min(begin, own.begin), end = std::max(end, own.end);
    seen.push_back(own);
  }
  Eigen::MatrixXd by = Eigen::MatrixXd::Zero(std::max(end - begin, 0), information.cols());
  by.col(0).setOnes();
  for (const Seen& own : seen) {
    set_derivatives(own.used->mode, sweep, own.begin, own.end,
                    by.block(own.begin - begin, own.used->column, own.end - own.begin, 6));
  }
  information(0, 0) += static_cast<double>(sweep.count - by.rows());
  information.noalias() += by.transpose() * by;
}

void MatteCovariance::add_wave_information(std::span<const Used> modes, int texture,
                                           Eigen::MatrixXd& information) const {
  const Waves& waves = waves_.at(texture);
  Eigen::MatrixXd by = Eigen::MatrixXd::Zero(waves.root.size(), information.cols()),
                  columns(waves.root.size(), PatternAnswers::kColumns);
  by.col(0) = waves.root;
  for (const Used& used : modes) {
    if (used.texture != texture) continue;
    // Widened by the monitor's pixels: derivatives of a narrow one's answers are those of a staircase.
    Footprint seen = used.mode;
    seen.xx_px2 += kFlatPixel_px2;
    seen.yy_px2 += kFlatPixel_px2;
    waves.answers.of(seen, false, columns.data(), columns.rows());
    by.middleCols(used.column, 6) = waves.root.cwiseProduct(waves.light).asDiagonal() * columns.rightCols(6);
  }
  information.noalias() += by.transpose() * by;
}

namespace {

// The places whose light the samples may confuse with the pyramid's: its own and those around them.
struct Unsure {
  std::vector<Footprint> places;         // of weight 1; the channel's modes that are kept come last
  std::vector<double> prior_sd, weight;  // of a mode: what it has without a pyramid; what is left
};

Unsure unsure_of(const PyramidFootprint& pyramid, std::span<const Mode> modes, const MonitorExtent& extent) {
  std::map<std::array<int, 3>, double> weights;
  const auto is_mode = [](const Coefficient& own) { return own.level >= kPyramidLevels; };
  const auto kept_mode = [&](const Coefficient& own) {
    return footprint_of(modes[static_cast<size_t>(own.level - kPyramidLevels)]);
  };
  const auto add_around = [&](int level, double x_px, double y_px, double reach_x_px, double reach_y_px) {
    const double step_px = std::ldexp(2.0, level);
    const auto cell = [&](double at_px, double side_px) {
      return static_cast<int>(std::floor(std::clamp(at_px, 0.0, std::nexttoward(side_px, 0.0L)) / step_px));
    };
    for (int row = cell(y_px - reach_y_px, extent.height_px);
         row <= cell(y_px + reach_y_px, extent.height_px); ++row) {
      for (int column = cell(x_px - reach_x_px, extent.width_px);
           column <= cell(x_px + reach_x_px, extent.width_px); ++column)
        weights.try_emplace({level, row, column});
    }
  };
  for (const Coefficient& own : pyramid.coefficients) {
    const Footprint at = is_mode(own) ? kept_mode(own) : footprint_of(mode_of(own, pyramid.texture));
    if (is_mode(own)) {
      // As wide as the mode on average, and no more than some ten along each axis.
      const double mean_px = std::pow(std::max(at.xx_px2 * at.yy_px2 - at.xy_px2 * at.xy_px2, 1.0), 0.25),
                   widest_px = std::sqrt(std::max(at.xx_px2, at.yy_px2));
      const int level = static_cast<int>(std::log2(std::max(mean_px, widest_px / 4.0)));
      add_around(level, at.x_px, at.y_px, std::sqrt(at.xx_px2), std::sqrt(at.yy_px2));
    } else {
      const double step_px = std::ldexp(2.0, own.level);
      add_around(own.level, at.x_px, at.y_px, step_px, step_px);
      weights[{own.level, own.row, own.column}] = own.weight;
    }
  }
  Unsure all;
  for (const auto& [place, weight] : weights) {
    all.places.push_back(footprint_of(
        mode_of({.level = place[0], .column = place[2], .row = place[1], .weight = 1.0f}, pyramid.texture)));
    all.prior_sd.push_back(std::ldexp(static_cast<double>(pyramid.prior_sd), 2 * place[0]));
    all.weight.push_back(weight);
  }
  for (const Coefficient& kept : pyramid.coefficients) {
    if (!is_mode(kept)) continue;
    all.places.push_back(kept_mode(kept));
    all.prior_sd.push_back(std::max(all.places.back().weight, static_cast<double>(kept.weight)));
    all.places.back().weight = 1.0;
    all.weight.push_back(kept.weight);
  }
  return all;
}

// A with A A' the mean of (x_j - x) (x_j - x)'.
Eigen::MatrixXd sampled_root(const Eigen::MatrixXd& a, const Eigen::VectorXd& x,
                             const Eigen::VectorXd& prior_sd) {
  const Eigen::Index size = a.cols();
  Eigen::MatrixXd n = a.transpose() * a;
  for (Eigen::Index k = 1; k < size; ++k) n(k, k) += std::pow(prior_sd[k - 1], -2);
  const Eigen::VectorXd b = n * x;
  PositiveSet above(static_cast<size_t>(size));
  for (Eigen::Index k = 0; k < size; ++k) {
    if (k == 0 || x[k] > 0.0) above.enter(n, b, k);
  }
  above.settle();
  std::mt19937 random;  // the same draws for every pixel
  std::normal_distribution<double> normal;
  Eigen::VectorXd noise(a.rows());
  Eigen::MatrixXd root(size, kDraws);
  for (Eigen::Index j = 0; j < kDraws; ++j) {
    for (double& own : noise) own = normal(random);
    Eigen::VectorXd drawn = b + a.transpose() * noise;
    for (Eigen::Index k = 1; k < size; ++k) drawn[k] += normal(random) / prior_sd[k - 1];
    root.col(j) = (positive_minimum(n, drawn, above) - x) / std::sqrt(static_cast<double>(kDraws));
  }
  return root;
}

}  // namespace

Eigen::MatrixXd MatteCovariance::answers_of(const std::vector<Footprint>& places,
                                            const PyramidFootprint& pyramid,
                                            const Eigen::VectorXd& weight) const {
  const MonitorExtent& extent = extents_[pyramid.texture];
  const Eigen::Index size = 1 + std::ssize(places);
  double dark = 1.0;  // samples that see none of the places, black among them
  std::vector<Eigen::MatrixXd> parts;
  for (const Sweep& sweep : sweeps_) {
    if (sweep.texture != pyramid.texture) continue;
    int begin = sweep.count, end = 0;
    for (const Footprint& place : places) {
      const auto [first, last] = seen_samples(place, sweep);
      if (first < last) begin = std::min(begin, first), end = std::max(end, last);
    }
    Eigen::MatrixXd& by = parts.emplace_back(std::max(end - begin, 0), size);
    dark += static_cast<double>(sweep.count - by.rows());
    by.col(0).setOnes();
    for (Eigen::Index k = 1; k < size; ++k) {
      for (Eigen::Index i = 0; i < by.rows(); ++i) {
        const double r_px = sweep.first_r_px + static_cast<double>(begin + i) * sweep.step_px;
        by(i, k) = sweep.light * response(places[k - 1], sweep.axis, r_px, extent);
      }
    }
  }
  if (const auto found = waves_.find(pyramid.texture); found != waves_.end()) {
    const Waves& waves = found->second;
    Eigen::MatrixXd& by = parts.emplace_back(waves.root.size(), size);
    Eigen::MatrixXd columns(by.rows(), PatternAnswers::kColumns);
    by.col(0) = waves.root;
    for (Eigen::Index k = 1; k < size; ++k) {
      waves.answers.of(places[k - 1], true, columns.data(), columns.rows());
      by.col(k) = waves.root.cwiseProduct(waves.light).cwiseProduct(columns.col(0));
    }
  }
  std::vector<LitShare> shares;
  for (const Footprint& place : places) shares.emplace_back(place, extent);
  const double noise = std::pow(static_cast<double>(pyramid.noise_sd), 2);
  for (const Picture& picture : pictures_) {
    if (picture.texture != pyramid.texture) continue;
    Eigen::MatrixXd& by = parts.emplace_back(1, size);
    by(0, 0) = 1.0;
    for (Eigen::Index k = 1; k < size; ++k) by(0, k) = picture.light * shares[k - 1].of(picture.lit).share;
    const double off = (picture.lit.bars ? kBarsError : kWhiteError) * by.row(0).tail(size - 1).dot(weight);
    by /= std::sqrt(1.0 / picture.count + off * off / noise);
  }
  Eigen::Index rows = 1;
  for (const Eigen::MatrixXd& part : parts) rows += part.rows();
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(rows, size);
  all(0, 0) = std::sqrt(dark);
  rows = 1;
  for (const Eigen::MatrixXd& part : parts) {
    all.middleRows(rows, part.rows()) = part;
    rows += part.rows();
  }
  return all / std::sqrt(noise);
}

PyramidErrors MatteCovariance::errors_of(const PyramidFootprint& pyramid, std::span<const Mode> modes) const {
  Unsure unsure = unsure_of(pyramid, modes, extents_[pyramid.texture]);
  const Eigen::Index size = std::ssize(unsure.places);
  const Eigen::Map<const Eigen::VectorXd> prior_sd(unsure.prior_sd.data(), size);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(1 + size);
  x.tail(size) = Eigen::Map<const Eigen::VectorXd>(unsure.weight.data(), size);
  if (!(x.sum() > 0.0) || !(pyramid.noise_sd > 0.0f) || !(pyramid.prior_sd > 0.0f)) return {};
  const Eigen::MatrixXd answers = answers_of(unsure.places, pyramid, x.tail(size));
  return {.places = std::move(unsure.places), .root = sampled_root(answers, x, prior_sd)};
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
  std::vector<double> weight_sd;
  for (const Mode& mode : modes) {
    if (mode.weight <= 0.0f) continue;
    used.push_back({.mode = footprint_of(mode),
                    .texture = mode.texture,
                    .column = 1 + 6 * static_cast<Eigen::Index>(used.size())});
    weight_sd.push_back(mode.weight_sd);
  }
  const auto highest = std::ranges::max_element(weight_sd);
  if (highest == weight_sd.end() || !(*highest > 0.0)) return {};
  const Eigen::MatrixXd sweeps = information_of(used);
  const std::vector<Shown> pictures = shown(used);
  const Eigen::Index size = sweeps.rows();
  // In units of each parameter's own information, so that N is as well conditioned as it can be.
  const Eigen::VectorXd unit = sweeps.diagonal().cwiseSqrt().cwiseInverse();
  if (!unit.allFinite()) return {};
  double s = *highest;
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
    double most = 0.0;
    for (size_t k = 0; k < used.size(); ++k) {
      const Eigen::VectorXd of_weight = Eigen::VectorXd::Unit(size, used[k].column);
      const double variance = of_weight.dot(factor.solve(of_weight));
      most = std::max(most, weight_sd[k] / (std::sqrt(variance) * unit[used[k].column]));
    }
    s = most;
  }
  const Eigen::LLT<Eigen::MatrixXd> noise(m);
  if (noise.info() != Eigen::Success) return {};
  const Eigen::MatrixXd root_of_m = noise.matrixL();
  return s * (unit.asDiagonal() * factor.solve(unit.asDiagonal() * root_of_m));
}

}  // namespace glasswing
