#include "solver/frames/frame_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/footprint/normal_rectangle.h"

namespace glasswing {
namespace {

constexpr double kGainPrior = 1.0;
constexpr double kOffsetPrior = 0.3, kFlatOffsetPrior = 1e-4;  // of pictures with and without dark parts
constexpr double kMaxGainSd = 0.005, kMaxOffsetSd = 0.002;     // of what counts as measured
constexpr double kShiftPrior_px = 2.0, kTurnPrior_rad = 0.02;
constexpr double kPlaceError_px = 0.02;
constexpr double kCut = 4.0;  // standard deviations, of Tukey's biweight
constexpr int kRounds = 4, kTurnRounds = 5;
constexpr double kCertainTurn = 4.0;  // standard deviations of a step, of which another round may follow
constexpr double kSettled = 1e-5;     // of gains, light, and px: a thirtieth of what noise moves
constexpr double kSameLight = 1e-6;   // of a solid without noise, whose gain and offset are the same
constexpr size_t kDarkPixels = 400;   // pixels beyond a stripe's light, which tell of nothing but its offset
constexpr double kReshow_px = 0.05;   // derivatives hold this far

}  // namespace

FrameFit::FrameFit(const SessionSamples& samples, const SeenMonitor& seen, const LitView::Picture& picture,
                   double noise_sd)
    : samples_(samples), seen_(seen), picture_(picture), noise_sd_(noise_sd) {
  at_.setZero();
  at_.head<kChannels>().setOnes();
  show();
}

void FrameFit::show() {
  shown_dx_px_ = at_[kShift];
  shown_dy_px_ = at_[kShift + 1];
  shown_.clear();
  for (const LitPixel& lit : seen_.view.pixels())
    shown_.push_back(picture_.at(lit, shown_dx_px_, shown_dy_px_));
}

FrameFit::Recorded FrameFit::recorded(double light) const {
  const double sd = seen_.cut_off_sd;
  if (sd == 0.0 || light > 4.0 * sd) return {.light = light, .by_light = 1.0};
  const double t = light / sd, above = normal_integral(t);
  return {.light = sd * (t * above + normal_density(t)), .by_light = above};
}

inline FrameFit::Rest FrameFit::rest_of(std::span<const float> light, size_t lit, size_t l, double h,
                                        double slope2) const {
  const size_t lanes = samples_.lanes_per_pixel;
  const size_t lane = seen_.view.pixels()[lit].pixel * lanes + l, at = lit * lanes + l;
  Rest rest{.channel = static_cast<size_t>(samples_.channel[lane])};
  const auto k = static_cast<Eigen::Index>(rest.channel);
  rest.whole = seen_.contrast[at] * picture_.level(static_cast<int>(rest.channel));
  const Recorded expected = recorded(seen_.black[at] + at_[k] * rest.whole * h + at_[kChannels + k]);
  rest.by_light = expected.by_light;
  rest.rest = light[lane] - expected.light;
  const double variance =
      noise_sd_ * noise_sd_ + kPlaceError_px * kPlaceError_px * slope2 * rest.whole * rest.whole;
  const double z2 = rest.rest * rest.rest / (variance * scale_ * scale_);
  if (!(z2 < kCut * kCut)) return rest;
  rest.part = 1.0 - z2 / (kCut * kCut);
  rest.weight = rest.part * rest.part / variance;
  return rest;
}

FrameFit::Sums FrameFit::sums(std::span<const float> light) const {
  Sums sums;
  for (size_t c = 0; c < kChannels; ++c) {
    sums.normal[c].setZero();
    sums.right[c].setZero();
  }
  const size_t lanes = samples_.lanes_per_pixel;
  const double dx = at_[kShift] - shown_dx_px_, dy = at_[kShift + 1] - shown_dy_px_;
  const size_t dark_step = 1 + shown_.size() / kDarkPixels;
  for (size_t i = 0; i < shown_.size(); ++i) {
    const LitPixel& lit = seen_.view.pixels()[i];
    const ShownLight& shown = shown_[i];
    if (std::isnan(shown.h) || (shown.h == 0.0 && picture_.is_stripe() && i % dark_step != 0)) continue;
    const double by_dx = -(shown.by_x * lit.x_by_x + shown.by_y * lit.y_by_x),
                 by_dy = -(shown.by_x * lit.x_by_y + shown.by_y * lit.y_by_y);
    const double h = shown.h + by_dx * dx + by_dy * dy;
    for (size_t l = 0; l < lanes; ++l) {
      const Rest own = rest_of(light, i, l, h, by_dx * by_dx + by_dy * by_dy);
      if (own.weight == 0.0) continue;
      const double moved = at_[own.channel] * own.whole;
      const Eigen::Vector4d by =
          own.by_light * Eigen::Vector4d(own.whole * h, 1.0, moved * by_dx, moved * by_dy);
      sums.normal[own.channel].noalias() += own.weight * by * by.transpose();
      sums.right[own.channel].noalias() += own.weight * own.rest * by;
      sums.chi_square += own.weight * own.rest * own.rest;
      sums.count += own.part * own.part;
    }
  }
  return sums;
}

void FrameFit::measure_turn(std::span<const float> light, FrameMeasure& measure) const {
  const Eigen::Vector3d prior(kShiftPrior_px, kShiftPrior_px, kTurnPrior_rad);
  Eigen::Vector3d at(at_[kShift] - shown_dx_px_, at_[kShift + 1] - shown_dy_px_, 0.0);
  // What lies far off counts little, and more with each round.
  for (int round = 0; round < kTurnRounds; ++round) {
    Eigen::Matrix3d normal = prior.cwiseAbs2().cwiseInverse().asDiagonal();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < shown_.size(); ++i) {
      const ShownLight& shown = shown_[i];
      if (shown.by_x == 0.0 && shown.by_y == 0.0) continue;
      const LitPixel& lit = seen_.view.pixels()[i];
      const SessionSamples::Pixel& place = samples_.pixels[lit.pixel];
      const double by_dx = -(shown.by_x * lit.x_by_x + shown.by_y * lit.y_by_x),
                   by_dy = -(shown.by_x * lit.x_by_y + shown.by_y * lit.y_by_y);
      const Eigen::Vector3d by_move(
          by_dx, by_dy, by_dy * (place.x - samples_.middle_x_px) - by_dx * (place.y - samples_.middle_y_px));
      for (size_t l = 0; l < static_cast<size_t>(samples_.lanes_per_pixel); ++l) {
        const Rest own = rest_of(light, i, l, shown.h + by_move.dot(at), by_dx * by_dx + by_dy * by_dy);
        const double moved = own.by_light * at_[own.channel] * own.whole;
        normal.noalias() += own.weight * moved * moved * by_move * by_move.transpose();
        right.noalias() += own.weight * own.rest * moved * by_move;
      }
    }
    const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
    const Eigen::Vector3d step = solver.solve(right);
    at += step;
    measure.turn_rad = at[2];
    measure.turn_sd_rad = scale_ * std::sqrt(solver.solve(Eigen::Vector3d::UnitZ())[2]);
    if (std::abs(step[2]) < kCertainTurn * measure.turn_sd_rad) break;
  }
}

FrameMeasure FrameFit::fit(std::span<const float> light, const std::array<double, kChannels>& offset) {
  Normal inverse;
  const double offset_prior = picture_.has_dark_parts() ? kOffsetPrior : kFlatOffsetPrior;
  Unknowns expected = Unknowns::Zero();
  for (size_t c = 0; c < kChannels; ++c) {
    expected[c] = 1.0;
    expected[static_cast<Eigen::Index>(c) + kChannels] = offset[c];
  }
  at_ = expected;
  scale_ = 30.0;
  for (int round = 0; round < kRounds; ++round) {
    const Sums own = sums(light);
    Normal normal = Normal::Zero();
    Unknowns right = Unknowns::Zero();
    for (Eigen::Index c = 0; c < kChannels; ++c) {
      const std::array<Eigen::Index, 4> place{c, kChannels + c, kShift, kShift + 1};
      for (Eigen::Index i = 0; i < 4; ++i) {
        right[place[i]] += own.right[c][i];
        for (Eigen::Index j = 0; j < 4; ++j) normal(place[i], place[j]) += own.normal[c](i, j);
      }
    }
    for (Eigen::Index i = 0; i < kUnknowns; ++i) {
      const double prior = i < kChannels ? kGainPrior : i < kShift ? offset_prior : kShiftPrior_px;
      normal(i, i) += 1.0 / (prior * prior);
      right[i] -= (at_[i] - expected[i]) / (prior * prior);
    }
    const Eigen::LDLT<Normal> solver(normal);
    const Unknowns step = solver.solve(right);
    at_ += step;
    inverse = solver.solve(Normal::Identity());
    scale_ = std::max(1.0, std::sqrt(own.chi_square / std::max(own.count, 1.0)));
    if (std::hypot(at_[kShift] - shown_dx_px_, at_[kShift + 1] - shown_dy_px_) > kReshow_px) show();
    if (round > 0 && step.cwiseAbs().maxCoeff() < kSettled) break;
  }
  FrameMeasure measure;
  for (size_t c = 0; c < kChannels; ++c) {
    const auto k = static_cast<Eigen::Index>(c);
    measure.gain[c] = at_[k];
    measure.offset[c] = at_[kChannels + k];
    measure.gain_sd = std::max(measure.gain_sd, scale_ * std::sqrt(inverse(k, k)));
    measure.offset_sd =
        std::max(measure.offset_sd, scale_ * std::sqrt(inverse(kChannels + k, kChannels + k)));
  }
  measure.measured = measure.gain_sd < kMaxGainSd;
  measure.dark = offset_prior == kOffsetPrior && measure.offset_sd < kMaxOffsetSd;
  measure.dx_px = at_[kShift];
  measure.dy_px = at_[kShift + 1];
  if (picture_.is_stripe()) {
    const Eigen::Matrix2d precision = inverse.bottomRightCorner<2, 2>().inverse() / (scale_ * scale_);
    measure.xx = precision(0, 0);
    measure.xy = precision(0, 1);
    measure.yy = precision(1, 1);
    measure_turn(light, measure);
  }
  return measure;
}

FrameFit::GhostEquations FrameFit::ghosts(std::span<const float> light,
                                          std::span<const std::span<const float>> last) const {
  constexpr Eigen::Index kOwn = 2, kAll = kOwn + static_cast<Eigen::Index>(kGhosts);
  GhostEquations whole;
  const size_t lanes = samples_.lanes_per_pixel;
  std::array<Eigen::Matrix<double, kAll, kAll>, kChannels> normal;
  std::array<Eigen::Matrix<double, kAll, 1>, kChannels> right;
  for (size_t c = 0; c < kChannels; ++c) {
    normal[c].setZero();
    right[c].setZero();
  }
  for (size_t i = 0; i < shown_.size(); ++i) {
    const LitPixel& lit = seen_.view.pixels()[i];
    if (std::isnan(shown_[i].h)) continue;
    for (size_t l = 0; l < lanes; ++l) {
      const size_t lane = lit.pixel * lanes + l, at = i * lanes + l;
      const size_t c = samples_.channel[lane];
      const auto k = static_cast<Eigen::Index>(c);
      const double contrast = seen_.contrast[at];
      const double shown = contrast * picture_.level(static_cast<int>(c)) * shown_[i].h;
      const double slope = contrast * std::hypot(shown_[i].by_x, shown_[i].by_y);
      const Recorded expected = recorded(seen_.black[at] + at_[k] * shown + at_[kChannels + k]);
      const double rest = light[lane] - expected.light;
      Eigen::Matrix<double, kAll, 1> by = Eigen::Matrix<double, kAll, 1>::Zero();
      by[0] = expected.by_light * shown;
      by[1] = expected.by_light;
      for (size_t g = 0; g < last.size(); ++g)
        by[kOwn + static_cast<Eigen::Index>(g)] =
            expected.by_light * static_cast<double>(last[g][lane] - seen_.black[at]);
      const double variance = noise_sd_ * noise_sd_ + kPlaceError_px * kPlaceError_px * slope * slope;
      const double z2 = rest * rest / (variance * scale_ * scale_);
      if (!(z2 < kCut * kCut) || !std::isfinite(by.sum())) continue;
      const double part = 1.0 - z2 / (kCut * kCut), weight = part * part / variance;
      normal[c].noalias() += weight * by * by.transpose();
      right[c].noalias() += weight * rest * by;
      whole.chi_square += weight * rest * rest;
      whole.count += part * part;
    }
  }
  for (size_t c = 0; c < kChannels; ++c) {
    Eigen::Matrix2d own = normal[c].topLeftCorner<kOwn, kOwn>();
    own += 1e-6 * Eigen::Matrix2d::Identity();
    own.diagonal() *= 1.0 + kSameLight;
    const Eigen::Matrix<double, kOwn, kAll - kOwn> cross = normal[c].topRightCorner<kOwn, kAll - kOwn>();
    const Eigen::Matrix<double, kOwn, kAll - kOwn> solved = own.inverse() * cross;
    whole.normal += normal[c].bottomRightCorner<kAll - kOwn, kAll - kOwn>() - cross.transpose() * solved;
    whole.right += right[c].tail<kAll - kOwn>() - solved.transpose() * right[c].head<kOwn>();
  }
  return whole;
}

}  // namespace glasswing
