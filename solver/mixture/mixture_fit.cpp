#include "solver/mixture/mixture_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "core/footprint/minimise.h"

namespace glasswing {
namespace {

constexpr double kBoundSd = 0.02;            // by which a weight may be above 1
constexpr double kLeastInformation = 1e-10;  // of a combination of parameters, over that of one alone
constexpr double kLittle = 1e-4;             // of chi2: a fit that gains no more has converged
constexpr double kRounding = 1e-6;           // of chi2, by lanes of float
constexpr size_t kMaxColumns = kMaxParameters + 1;

struct Equations : FootprintEquations {
  double chi2 = 0.0, floor = 0.0;  // without what weights above 1 cost
};

// The answers of all modes, and what they leave of the samples.
struct Columns {
  Columns(const MixtureLanes& samples, const Footprints& modes, bool through_pixels)
      : size(samples.patterns->size()),
        answers(std::make_unique_for_overwrite<float[]>(PatternLanes::kColumns * size *
                                                        static_cast<size_t>(modes.size()))),
        residual(samples.y) {
    for (int m = 0; m < modes.size(); ++m) {
      float* const own = answers.get() + PatternLanes::kColumns * size * static_cast<size_t>(m);
      samples.patterns->answer(modes[m], through_pixels, samples.peak.data(), own);
      for (size_t k = 0; k < size; ++k) residual[k] -= own[k];
    }
    floor = internal::dot(samples.root.data(), residual.data(), size) / samples.information;
  }
  float* slope(int parameter) {
    return answers.get() + size * static_cast<size_t>(parameter + parameter / 6 + 1);
  }

  const size_t size;
  std::unique_ptr<float[]> answers;
  std::vector<float> residual;
  double floor = 0.0;
};

void evaluate(const MixtureLanes& samples, const Footprints& modes, bool through_pixels,
              Equations& equations) {
  Columns columns(samples, modes, through_pixels);
  const int parameters = 6 * modes.size();
  std::array<float*, kMaxColumns> all;
  for (int p = 0; p < parameters; ++p) all[p] = columns.slope(p);
  all[parameters] = columns.residual.data();
  const std::span<float* const> used(all.data(), static_cast<size_t>(parameters) + 1);
  // The minimum over F.
  internal::centre(samples.root.data(), samples.information, used, columns.size);
  std::array<float, kMaxColumns*(kMaxColumns + 1) / 2> products;
  internal::multiply(used, columns.size, products.data());
  equations.matrix.resize(parameters, parameters);
  equations.gradient.resize(parameters);
  const float* at = products.data();
  for (int p = 0; p < parameters; ++p) {
    for (int q = 0; q <= p; ++q) equations.matrix(p, q) = equations.matrix(q, p) = static_cast<double>(*at++);
  }
  for (int p = 0; p < parameters; ++p) equations.gradient[p] = static_cast<double>(*at++);
  equations.chi2 = equations.cost = static_cast<double>(*at);
  equations.floor = columns.floor;
  for (int m = 0; m < modes.size(); ++m) {
    const double excess = std::max(modes[m].weight - 1.0, 0.0), bound = 1.0 / (kBoundSd * kBoundSd);
    if (excess == 0.0) continue;
    equations.cost += bound * excess * excess;
    equations.matrix(6 * m, 6 * m) += bound;
    equations.gradient[6 * m] -= bound * excess;
  }
  equations.enough = std::max(equations.chi2 / samples.count, 1.0);
  equations.little = kLittle * equations.cost;
  equations.rounding = kRounding;
}

bool sane(const Footprints& modes, const MonitorExtent& extent) {
  const double limit = 2.0 * (extent.width_px + extent.height_px);
  return std::all_of(modes.begin(), modes.end(), [&](const Footprint& mode) {
    return mode.weight > 0.0 && std::abs(mode.x_px) < limit && std::abs(mode.y_px) < limit &&
           mode.xx_px2 + mode.yy_px2 < limit * limit;
  });
}

}  // namespace

MixtureLanes::MixtureLanes(const MixtureSamples& samples)
    : patterns(samples.patterns),
      count(static_cast<int>(samples.size())),
      information(samples.weight.sum()),
      y(patterns->size()),
      root(patterns->size()),
      peak(patterns->size()) {
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    const size_t pattern = i;
    const size_t k = pattern < patterns->pattern_count() ? patterns->lane(pattern) : patterns->black_lane();
    const double own = std::sqrt(samples.weight[i]);
    root[k] = static_cast<float>(own);
    y[k] = static_cast<float>(own * samples.y[i]);
    peak[k] = static_cast<float>(own * samples.peak[i]);
  }
}

Residual residual_of(const MixtureLanes& samples, const Footprints& modes, bool through_pixels) {
  Columns columns(samples, modes, through_pixels);
  float* const residual = columns.residual.data();
  internal::centre(samples.root.data(), samples.information, {&residual, 1}, columns.size);
  const double chi2 = internal::dot(residual, residual, columns.size);
  return {.lanes = std::move(columns.residual), .floor = columns.floor, .chi2 = chi2};
}

std::vector<double> model_of(const MixtureSamples& samples, const Footprints& modes, bool through_pixels) {
  const PatternLanes& patterns = *samples.patterns;
  std::vector<float> peak(patterns.size()), columns(PatternLanes::kColumns * patterns.size());
  for (size_t i = 0; i < patterns.pattern_count(); ++i)
    peak[patterns.lane(i)] = static_cast<float>(samples.peak[i]);
  std::vector<double> model(patterns.pattern_count() + 1);
  for (const Footprint& mode : modes) {
    patterns.answer(mode, through_pixels, peak.data(), columns.data());
    for (size_t i = 0; i < patterns.pattern_count(); ++i)
      model[i] += static_cast<double>(columns[patterns.lane(i)]);
  }
  return model;
}

MixtureFit fit_mixture(const MixtureLanes& samples, const Footprints& start, bool through_pixels,
                       int max_steps, double enough) {
  const MonitorExtent& extent = samples.patterns->answers().extent();
  const Minimum<Equations> found = minimise<Equations>(
      start,
      [&](const Footprints& modes, Equations& at) {
        evaluate(samples, modes, through_pixels, at);
        at.enough *= enough;
      },
      [&](const Footprints& modes) { return sane(modes, extent); }, {.max_steps = max_steps});
  return {.modes = found.modes, .chi2 = found.at.chi2, .floor = found.at.floor, .converged = found.converged};
}

void find_errors(const MixtureLanes& samples, MixtureFit& fit) {
  fit.weight_sd.fill(std::numeric_limits<double>::infinity());
  fit.centre_sd_px.fill(std::numeric_limits<double>::infinity());
  const Eigen::Index size = 6 * fit.modes.size();
  if (size == 0) return;
  // As wide as the monitor's pixels make them: a point that moves within a pixel changes no sample, though
  // its place is known. Where samples tell nothing of a parameter, a footprint lies on the monitor.
  Footprints seen = fit.modes;
  for (Footprint& mode : seen) {
    mode.xx_px2 += kFlatPixel_px2;
    mode.yy_px2 += kFlatPixel_px2;
  }
  Equations equations;
  evaluate(samples, seen, false, equations);
  FootprintMatrix information = equations.matrix;
  const MonitorExtent& extent = samples.patterns->answers().extent();
  const double side_px = std::max(extent.width_px, extent.height_px);
  for (int m = 0; m < fit.modes.size(); ++m) {
    for (Eigen::Index p = 0; p < 6; ++p)
      information(6 * m + p, 6 * m + p) += std::pow(side_px, p == 0 ? 0.0 : p < 3 ? -2.0 : -4.0);
  }
  const FootprintVector unit = information.diagonal().cwiseSqrt().cwiseInverse();
  FootprintMatrix scaled = unit.asDiagonal() * information * unit.asDiagonal();
  scaled.diagonal().array() += kLeastInformation;
  const FootprintCholesky factor(scaled);
  if (!factor.positive()) return;
  const FootprintMatrix covariance = unit.asDiagonal() * factor.inverse() * unit.asDiagonal();
  for (int m = 0; m < fit.modes.size(); ++m) {
    const Eigen::Index k = 6 * m;
    const size_t i = m;
    fit.weight_sd[i] = std::sqrt(covariance(k, k));
    fit.centre_sd_px[i] = std::sqrt(0.5 * (covariance(k + 1, k + 1) + covariance(k + 2, k + 2)));
  }
}

}  // namespace glasswing
