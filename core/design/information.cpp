#include "core/design/information.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/footprint/lit_area.h"
#include "core/footprint/wave_answer.h"

namespace glasswing {
namespace {

constexpr double kBlackSd = 0.05;        // of F
constexpr int kRadii = 10, kAngles = 8;  // of the background's spectrum
constexpr double kFinestDetail = 0.25;   // cycles a pixel, of a background

}  // namespace

ShownPattern wave_of(const DesignedWave& wave, double phase_rad) {
  const double phi_rad = wave.phi_deg * std::numbers::pi / 180.0;
  ShownPattern pattern;
  pattern.kind = ShownPattern::Kind::kWave;
  pattern.fx = std::cos(phi_rad) / wave.period_px;
  pattern.fy = std::sin(phi_rad) / wave.period_px;
  pattern.phase_rad = phase_rad;
  return pattern;
}

void add_phases(const DesignedWave& wave, std::vector<ShownPattern>& patterns) {
  for (const double phase_rad : {0.0, 0.5 * std::numbers::pi}) patterns.push_back(wave_of(wave, phase_rad));
}

// Equal on every octave.
Background::Background(const MonitorExtent& extent) : extent_(extent) {
  const double lowest = 1.0 / std::max(extent.width_px, extent.height_px);
  for (int r = 0; r < kRadii; ++r) {
    const double f = lowest * std::pow(kFinestDetail / lowest, static_cast<double>(r) / (kRadii - 1));
    for (int a = 0; a < kAngles; ++a) {
      const double angle = std::numbers::pi * a / kAngles;
      details_.push_back(
          {f * std::cos(angle), f * std::sin(angle), kContrast * kContrast / (kRadii * kAngles)});
    }
  }
}

Eigen::MatrixXd Background::weight(const Footprints& modes) const {
  constexpr double kEndless_px = 1e9;
  Footprints inside = modes;
  for (Footprint& mode : inside) mode.x_px += 0.5 * kEndless_px, mode.y_px += 0.5 * kEndless_px;
  return weight(inside, {.width_px = kEndless_px, .height_px = kEndless_px});
}

Eigen::MatrixXd Background::weight_on_monitor(const Footprints& modes) const {
  return weight(modes, extent_);
}

Eigen::MatrixXd Background::weight(const Footprints& modes, const MonitorExtent& extent) const {
  const Eigen::Index size = 6 * modes.size();
  Eigen::MatrixXd weight = Eigen::MatrixXd::Zero(size, size);
  Eigen::MatrixXd by(size, 2);
  for (const Detail& detail : details_) {
    for (int m = 0; m < modes.size(); ++m) {
      const WaveAnswer answer = answer_of(modes[m], detail.fx, detail.fy, extent);
      for (size_t p = 0; p < 6; ++p) {
        by(6 * m + static_cast<Eigen::Index>(p), 0) = answer.slope[p].real();
        by(6 * m + static_cast<Eigen::Index>(p), 1) = answer.slope[p].imag();
      }
    }
    weight += detail.power * by * by.transpose();
  }
  return weight;
}

Eigen::MatrixXd whitened_slopes(const PatternAnswers& patterns, const Footprints& modes,
                                const CameraNoise& noise, std::span<const double> noise_scale) {
  const Eigen::Index n = patterns.size() + 1;
  Eigen::MatrixXd by = Eigen::MatrixXd::Zero(n, 6 * modes.size() + 1), columns(n, PatternAnswers::kColumns);
  Eigen::VectorXd light = Eigen::VectorXd::Zero(n);
  by.col(0).setOnes();  // F
  for (int m = 0; m < modes.size(); ++m) {
    columns.setZero();
    // The pixels' own covariance is part of the prior's widths.
    patterns.of(modes[m], false, columns.data(), n);
    light += columns.col(0);
    by.middleCols(6 * m + 1, 6) = columns.rightCols(6);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    double variance = noise.variance(light[i]);
    if (i < std::ssize(noise_scale)) variance *= std::pow(noise_scale[i], 2);
    // Bars are trusted within limits (lit_area.h).
    if (i + 1 < n && patterns.patterns()[i].lit.bars) {
      double off = kBarsError * light[i];
      for (const Footprint& mode : modes)
        off += mode.weight * lit_share_error(mode, patterns.patterns()[i].lit, patterns.extent());
      variance += off * off;
    }
    by.row(i) /= std::sqrt(variance);
  }
  return by;
}

Eigen::MatrixXd prior_information(int mode_count, const MonitorExtent& extent, double widest_px) {
  const Eigen::Index size = 6 * mode_count + 1;
  Eigen::VectorXd known = Eigen::VectorXd::Zero(size);
  const auto know = [&](Eigen::Index at, double sd) { known[at] = 1.0 / (sd * sd); };
  know(0, kBlackSd);
  for (Eigen::Index m = 1; m < size; m += 6) {
    know(m, 1.0);
    know(m + 1, extent.width_px / std::sqrt(12.0));
    know(m + 2, extent.height_px / std::sqrt(12.0));
    for (Eigen::Index p = 3; p < 6; ++p) know(m + p, widest_px * widest_px);
  }
  return known.asDiagonal();
}

}  // namespace glasswing
