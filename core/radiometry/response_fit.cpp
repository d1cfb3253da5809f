#include "core/radiometry/response_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/radiometry/log_curve.h"

namespace glasswing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kPasses = 10;
constexpr int kPassesToTrust = 4;  // before outliers are rejected and codes predicted
// b: the variance of d ln f / d ln z per ln z. For simulated cameras with gamma 1.8 to 2.6, sRGB, a film
// shoulder or S shapes of contrast 0.2 to 0.8 the likelihood peaks at 0 to 0.9; larger values fit staircases
// (docs/calibration.md).
constexpr double kMaxBend = 1.0, kFirstBend = 0.02, kMinBend = 1e-4;
constexpr size_t kMinAtKnot = 20;    // samples; below the first such knot the curve is extrapolated
constexpr double kHoldTimes = 1e12;  // weights of constraints
constexpr double kHoldTop = 1e8;
constexpr double kOutlier = 4.0;       // standard deviations
constexpr double kMaxRelative = 0.3;   // noise of an exposure; its logarithm is useless beyond
constexpr double kMinNoise = 1e-4;     // of a code; far below the step of 8 bits
constexpr double kFirstNoise = 0.005;  // before it is estimated from residuals
constexpr double kMinKept = 0.3;       // of a residual; below, its sample alone determined ln E
constexpr int kNoiseBins = 16;
constexpr size_t kMinSamples = 100;  // of a bin, to estimate its noise

// The normal equations for changes of s (per channel) and of ln t.
struct Equations {
  explicit Equations(Eigen::Index frames)
      : times(MatrixXd::Zero(frames, frames)), right_times(VectorXd::Zero(frames)) {
    for (size_t c = 0; c < 3; ++c) {
      curves[c] = MatrixXd::Zero(kKnots, kKnots);
      both[c] = MatrixXd::Zero(kKnots, frames);
      right[c] = VectorXd::Zero(kKnots);
    }
  }
  std::array<MatrixXd, 3> curves, both;
  std::array<VectorXd, 3> right;
  MatrixXd times;
  VectorXd right_times;
};

struct Solution {
  std::array<VectorXd, 3> curves;
  VectorXd times;
  std::array<Eigen::LLT<MatrixXd>, 3> factors;
  std::array<MatrixXd, 3> coupling;  // curves^-1 both
  Eigen::LLT<MatrixXd> time_factors;
  double log_likelihood = 0.0;

  VectorXd variances(size_t c) const {
    const MatrixXd own = factors[c].solve(MatrixXd::Identity(kKnots, kKnots));
    const MatrixXd spread = time_factors.solve(coupling[c].transpose());
    return own.diagonal() + coupling[c].cwiseProduct(spread.transpose()).rowwise().sum();
  }
};

double log_determinant(const Eigen::LLT<MatrixXd>& factors) {
  return 2.0 * MatrixXd(factors.matrixL()).diagonal().array().log().sum();
}

class Fit {
 public:
  Fit(const std::array<ChannelSamples, 3>& channels, std::span<const double> declared_s,
      const ResponseOptions& options)
      : channels_(channels),
        options_(options),
        declared_(declared_s.size()),
        black_(options.black_level.value_or(std::array{0.0, 0.0, 0.0})),
        curves_{LogCurve(black_[0]), LogCurve(black_[1]), LogCurve(black_[2])} {
    for (size_t j = 0; j < declared_s.size(); ++j) declared_[j] = std::log(declared_s[j]);
    times_ = declared_;
    for (size_t c = 0; c < 3; ++c) {
      noise_[c].fill(kFirstNoise);
      lights_[c].resize(channels[c].first.size() - 1);
      roughness_[c] = roughness_of(black_[c]);
    }
  }

  ResponseFit run() {
    Solution solution;
    for (; passes_ < kPasses; ++passes_) {
      solution = step();
      for (size_t c = 0; c < 3; ++c) learn_noise(c);
    }
    ResponseFit result;
    for (size_t c = 0; c < 3; ++c) finish(c, solution.variances(c), result);
    for (const double time : times_) result.exposures_s.push_back(std::exp(time));
    return result;
  }

 private:
  struct Term {
    double weight;    // inverse variance of ln f; 0: ignored
    double residual;  // ln f - ln t - ln E
    double per_code;  // of ln f
    double code;      // where the curve is changed
  };

  bool predicts() const { return passes_ >= kPassesToTrust; }

  // Computes weights and residuals of one pixel's samples; returns their weighted mean ln E. A curve
  // evaluated at noisy codes is biased flat. So once there is a curve, it is evaluated at the codes it
  // predicts: residuals are then those of codes, in units of ln f.
  double weigh(size_t c, size_t pixel, bool robust) {
    const ChannelSamples& channel = channels_[c];
    const LogCurve& curve = curves_[c];
    const double light = lights_[c][pixel];
    terms_.clear();
    for (size_t s = channel.first[pixel]; s < channel.first[pixel + 1]; ++s) {
      const CodeSample& sample = channel.samples[s];
      const double seen = sample.code, time = times_[sample.frame];
      const double code = predicts() ? curve.code_of(light + time) : seen;
      Term term{0.0, 0.0, curve.slope(code), code};
      const double noise = term.per_code * code_noise(c, code, sample);
      if (noise < kMaxRelative) {
        term.weight = 1.0 / (noise * noise);
        term.residual = curve(code) + term.per_code * (seen - code) - time;
      }
      terms_.push_back(term);
    }
    const double found = mean_residual().value_or(light);
    for (Term& term : terms_) {
      if (term.weight == 0.0) continue;
      term.residual -= found;
      if (!robust) continue;
      const double off = term.residual * std::sqrt(term.weight) / kOutlier;
      const double keep = std::max(1.0 - off * off, 0.0);
      term.weight *= keep * keep;
    }
    return found + (robust ? mean_residual().value_or(0.0) : 0.0);
  }

  std::optional<double> mean_residual() const {
    double sum = 0.0, weights = 0.0;
    for (const Term& term : terms_) sum += term.weight * term.residual, weights += term.weight;
    if (weights == 0.0) return std::nullopt;
    return sum / weights;
  }

  double code_noise(size_t c, double code, const CodeSample& sample) const {
    return std::hypot(noise_[c][bin_of(code)], options_.alignment_sd_px * sample.gradient);
  }
  static size_t bin_of(double code) {
    return static_cast<size_t>(std::clamp(static_cast<int>(code * kNoiseBins), 0, kNoiseBins - 1));
  }

  // One pixel's samples, J x + r, ln E eliminated: sum w J J' - (sum w J)(sum w J)' / sum w.
  void add_pixel(size_t c, size_t pixel, Equations& equations) {
    entries_.clear();
    double weights = 0.0, offset = 0.0;
    MatrixXd& curve = equations.curves[c];
    for (size_t i = 0; i < terms_.size(); ++i) {
      const Term& term = terms_[i];
      if (term.weight == 0.0) continue;
      const int frame = channels_[c].samples[channels_[c].first[pixel] + i].frame;
      const KnotPosition position = knot_position_of(term.code);
      const int k = position.knot;
      const double a = 1.0 - position.above, b = position.above, w = term.weight;
      curve(k, k) += w * a * a, curve(k, k + 1) += w * a * b;
      curve(k + 1, k) += w * a * b, curve(k + 1, k + 1) += w * b * b;
      equations.both[c](k, frame) -= w * a, equations.both[c](k + 1, frame) -= w * b;
      equations.times(frame, frame) += w;
      equations.right[c][k] -= w * a * term.residual, equations.right[c][k + 1] -= w * b * term.residual;
      equations.right_times[frame] += w * term.residual;
      entries_.push_back({k, w * a}), entries_.push_back({k + 1, w * b});
      entries_.push_back({kKnots + frame, -w});
      weights += w, offset += w * term.residual;
    }
    for (const auto& [k, a] : entries_) {
      for (const auto& [l, b] : entries_) {
        const double change = a * b / weights;
        if (k < kKnots && l < kKnots) curve(k, l) -= change;
        if (k < kKnots && l >= kKnots) equations.both[c](k, l - kKnots) -= change;
        if (k >= kKnots && l >= kKnots) equations.times(k - kKnots, l - kKnots) -= change;
      }
      (k < kKnots ? equations.right[c][k] : equations.right_times[k - kKnots]) += a * offset / weights;
    }
  }

  // The roughness penalty of ln f, times b.
  static MatrixXd roughness_of(double black) {
    MatrixXd roughness = MatrixXd::Zero(kKnots, kKnots);
    for (int k = 1; k < kKnots - 1; ++k) {
      const double above = k - black * kKnotsPerCode, here = soft_log(above);
      const double before = here - soft_log(above - 1.0), after = soft_log(above + 1.0) - here;
      const Eigen::Vector3d bend(1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after);
      roughness.block<3, 3>(k - 1, k - 1) += bend * bend.transpose() / (0.5 * (before + after));
    }
    return roughness;
  }

  Solution solve(const Equations& equations, double cost, double bend) const {
    Solution solution;
    const Eigen::Index frames = times_.size();
    // The prior of the declared times; mean and slope of ln t are held.
    const VectorXd off = times_ - declared_,
                   centred = (declared_.array() - declared_.mean()).matrix().normalized();
    const double precision = 1.0 / (options_.exposure_sd * options_.exposure_sd);
    MatrixXd times = equations.times + precision * MatrixXd::Identity(frames, frames);
    times += kHoldTimes * (centred * centred.transpose() +
                           MatrixXd::Constant(frames, frames, 1.0 / static_cast<double>(frames)));
    VectorXd right = equations.right_times - precision * off;
    std::array<VectorXd, 3> rights;
    const KnotPosition top = knot_position_of(options_.saturation);
    const Eigen::Vector2d hold(1.0 - top.above, top.above);
    double determinants = 0.0;
    cost += precision * off.squaredNorm();
    for (size_t c = 0; c < 3; ++c) {
      MatrixXd curve = equations.curves[c] + roughness_[c] / bend;
      curve.block<2, 2>(top.knot, top.knot) += kHoldTop * hold * hold.transpose();
      const Eigen::Map<const VectorXd> rest(curves_[c].rest().data(), kKnots);
      const VectorXd rough = roughness_[c] * rest / bend;
      cost += rest.dot(rough);
      rights[c] = equations.right[c] - rough;
      solution.factors[c].compute(curve);
      solution.coupling[c] = solution.factors[c].solve(equations.both[c]);
      times -= equations.both[c].transpose() * solution.coupling[c];
      right -= solution.coupling[c].transpose() * rights[c];
      determinants += log_determinant(solution.factors[c]);
    }
    solution.time_factors.compute(times);
    solution.times = solution.time_factors.solve(right);
    cost -= solution.times.dot(right);
    for (size_t c = 0; c < 3; ++c) {
      const VectorXd alone = solution.factors[c].solve(rights[c]);
      cost -= alone.dot(rights[c]);
      solution.curves[c] = alone - solution.coupling[c] * solution.times;
    }
    determinants += log_determinant(solution.time_factors);
    solution.log_likelihood = -0.5 * (cost + determinants + 3.0 * (kKnots - 2) * std::log(bend));
    return solution;
  }

  // One Gauss-Newton step, with the bend of maximum likelihood.
  Solution step() {
    Equations equations(times_.size());
    double cost = 0.0;
    for (size_t c = 0; c < 3; ++c) {
      for (size_t i = 0; i < lights_[c].size(); ++i) {
        lights_[c][i] = weigh(c, i, predicts());
        if (predicts()) lights_[c][i] = weigh(c, i, true);
        const std::optional<double> mean = mean_residual();
        if (!mean) continue;
        for (const Term& term : terms_) cost += term.weight * std::pow(term.residual - *mean, 2);
        add_pixel(c, i, equations);
      }
    }
    Solution best = solve(equations, cost, bend_);
    const auto try_factor = [&](double factor) {
      const double bend = std::clamp(bend_ * factor, kMinBend, kMaxBend);
      if (bend == bend_) return false;
      Solution other = solve(equations, cost, bend);
      if (!(other.log_likelihood > best.log_likelihood)) return false;
      best = std::move(other);
      bend_ = bend;
      return true;
    };
    for (const double factor : {4.0, 0.25, 1.4, 1.0 / 1.4}) {
      while (predicts() && try_factor(factor)) continue;
    }
    for (size_t c = 0; c < 3; ++c) curves_[c].add(best.curves[c], equations.curves[c].diagonal());
    times_ += best.times;
    return best;
  }

  void finish(size_t c, const VectorXd& variances, ResponseFit& result) {
    LogCurve::Knots& curve = result.exposures[c];
    const double top = curves_[c](options_.saturation);
    for (size_t k = 0; k < kKnots; ++k) {
      curve[k] = std::exp(curves_[c].at_knot(k) - top);
      result.errors[c][k] = curve[k] * std::sqrt(std::max(variances[k], 0.0));
    }
    continue_to_black(c, result);
  }

  // Where noise dominates the exposure, its logarithm is not fitted. There the curve is extrapolated by a
  // parabola down to the black level and a line below it, or by a line alone if the black level is unknown.
  void continue_to_black(size_t c, ResponseFit& result) {
    LogCurve::Knots& curve = result.exposures[c];
    std::array<size_t, kKnots> count{};
    for (size_t i = 0; i < lights_[c].size(); ++i) {
      weigh(c, i, true);
      for (const Term& term : terms_) {
        if (term.weight > 0.0) ++count[knot_position_of(term.code).knot];
      }
    }
    size_t first = 1;
    while (first + 8 < kKnots && count[first] < kMinAtKnot) ++first;
    const double black = black_[c] * kKnotsPerCode, near = static_cast<double>(first) - black,
                 far = near + 4.0;
    const double error = result.errors[c][first];
    if (!options_.black_level || near <= 0.0) {
      const double slope = (curve[first + 3] - curve[first]) / 3.0;
      for (size_t k = 0; k < first; ++k) {
        curve[k] = curve[first] - slope * static_cast<double>(first - k);
        result.errors[c][k] = std::max(error, std::abs(curve[k]));
      }
      return;
    }
    // Through both points, limited so that it rises up to them.
    const double chord = curve[first] / near;
    const double bend = std::clamp((curve[first + 4] / far - chord) / (far - near), -chord / (2.0 * far),
                                   chord / (2.0 * near));
    const double slope = chord - bend * near;
    for (size_t k = 0; k < first; ++k) {
      const double above = static_cast<double>(k) - black;
      curve[k] = above * (slope + (above > 0.0 ? bend * above : 0.0));
      result.errors[c][k] = error;
    }
  }

  // Estimates the standard deviation of codes by brightness: 1.4826 median |residual|, in codes, corrected
  // for the degree of freedom that a pixel's fitted E takes.
  void learn_noise(size_t c) {
    std::array<std::vector<double>, kNoiseBins> off;
    for (size_t i = 0; i < lights_[c].size(); ++i) {
      weigh(c, i, false);
      double weights = 0.0;
      for (const Term& term : terms_) weights += term.weight;
      for (size_t s = 0; s < terms_.size(); ++s) {
        const Term& term = terms_[s];
        const double kept = 1.0 - term.weight / weights;
        if (term.weight == 0.0 || kept < kMinKept) continue;
        const CodeSample& sample = channels_[c].samples[channels_[c].first[i] + s];
        const size_t bin = bin_of(term.code);
        const double share = noise_[c][bin] / code_noise(c, term.code, sample);
        off[bin].push_back(std::abs(term.residual) / term.per_code * share / std::sqrt(kept));
      }
    }
    for (size_t bin = 0; bin < kNoiseBins; ++bin) {
      if (off[bin].size() < kMinSamples) continue;
      const auto middle = off[bin].begin() + off[bin].size() / 2;
      std::nth_element(off[bin].begin(), middle, off[bin].end());
      noise_[c][bin] = std::max(1.4826 * *middle, kMinNoise);
    }
  }

  const std::array<ChannelSamples, 3>& channels_;
  const ResponseOptions& options_;
  VectorXd declared_, times_;  // ln t
  const std::array<double, 3> black_;
  std::array<LogCurve, 3> curves_;
  std::array<std::vector<double>, 3> lights_;  // ln E by pixel
  std::array<std::array<double, kNoiseBins>, 3> noise_;
  std::array<MatrixXd, 3> roughness_;
  double bend_ = kFirstBend;
  std::vector<Term> terms_;
  std::vector<std::pair<int, double>> entries_;
  int passes_ = 0;
};

}  // namespace

ResponseFit fit_response(const std::array<ChannelSamples, 3>& channels, std::span<const double> declared_s,
                         const ResponseOptions& options) {
  return Fit(channels, declared_s, options).run();
}

}  // namespace glasswing
