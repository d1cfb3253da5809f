#include "core/radiometry/response_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

constexpr int kKnots = CameraResponse::kKnots;
constexpr double kKnotsPerCode = kKnots - 1;
constexpr int kPasses = 12;
constexpr int kPassesToTrust = 4;      // before residuals tell what moved
constexpr double kSmoothness = 0.004;  // per sample, of the squared change of d ln f / d ln z, by ln z
constexpr double kLeastRise = 1e-6;    // of ln f, from knot to knot
constexpr size_t kFewestAtKnot = 20;   // samples; a darker curve is continued as a straight line
constexpr double kFirstPower = 2.2;    // for the first weights only
constexpr double kHold = 1e12;         // weight of what is so by definition
constexpr double kMostTimeSigmas = 3.0;
constexpr double kLeastPower = 0.5;    // d ln f / d ln z, for weights only
constexpr double kOutlier = 4.0;       // standard deviations
constexpr double kMostRelative = 0.3;  // noise of an exposure, beyond which its logarithm means nothing
constexpr double kLeastNoise = 1e-4;   // of a code; far below 8 bits' steps
constexpr double kFirstNoise = 0.005;  // until residuals tell
constexpr double kLeastKept = 0.3;     // of a residual; else its sample set ln E all but alone
constexpr int kNoiseBins = 16;
constexpr size_t kFewest = 100;  // samples, to learn a bin's noise from

using Curve = std::array<double, kKnots>;

struct Place {
  int knot;
  double above;  // share of the next knot
};

Place place_of(double code) {
  const double at = code * kKnotsPerCode;
  const int knot = std::clamp(static_cast<int>(at), 0, kKnots - 2);
  return {knot, at - knot};
}

double value_at(const Curve& curve, double code) {
  const Place place = place_of(code);
  const auto knot = static_cast<size_t>(place.knot);
  return (1.0 - place.above) * curve[knot] + place.above * curve[knot + 1];
}

// d ln f / d code, over a share of the code, as single steps are noisy; cameras' curves are never all flat.
double slope_at(const Curve& curve, int knot) {
  const int reach = std::max(2, knot / 4);
  const int low = std::max(knot - reach, 0), high = std::min(knot + reach, kKnots - 1);
  const double rise = curve[static_cast<size_t>(high)] - curve[static_cast<size_t>(low)];
  return std::max(rise / (high - low), kLeastPower / (knot + 1)) * kKnotsPerCode;
}

// The closest curve, weighted, that rises by kLeastRise and more at every knot: adjacent violators are
// pooled.
void make_monotone(Curve& curve, const Eigen::VectorXd& weights) {
  struct Pool {
    double value, weight;
    int count;
  };
  std::vector<Pool> pools;
  for (int k = 0; k < kKnots; ++k) {
    Pool pool{curve[static_cast<size_t>(k)] - kLeastRise * k, weights[k], 1};
    while (!pools.empty() && pools.back().value >= pool.value) {
      const Pool& last = pools.back();
      const double weight = last.weight + pool.weight;
      pool = {(last.value * last.weight + pool.value * pool.weight) / weight, weight,
              last.count + pool.count};
      pools.pop_back();
    }
    pools.push_back(pool);
  }
  size_t k = 0;
  for (const Pool& pool : pools) {
    for (int i = 0; i < pool.count; ++i, ++k) curve[k] = pool.value + kLeastRise * static_cast<double>(k);
  }
}

class Fit {
 public:
  Fit(const std::array<ChannelSamples, 3>& channels, std::span<const double> declared_s,
      const ResponseOptions& options)
      : channels_(channels), declared_s_(declared_s), options_(options) {
    result_.exposures_s.assign(declared_s.begin(), declared_s.end());
    for (size_t c = 0; c < 3; ++c) {
      for (int k = 0; k < kKnots; ++k) {
        logs_[c][static_cast<size_t>(k)] = kFirstPower * std::log((k + 0.5) / kKnots);
      }
      noise_[c].fill(kFirstNoise);
    }
  }

  ResponseFit run() {
    for (; passes_ < kPasses; ++passes_) {
      for (size_t c = 0; c < 3; ++c) solve(c, passes_ + 1 == kPasses);
      for (size_t c = 0; c < 3; ++c) learn_noise(c);
      if (passes_ >= kPassesToTrust && passes_ + 1 < kPasses) refine_times();
    }
    return result_;
  }

 private:
  struct Term {
    double weight;    // inverse variance of ln f; 0: does not count
    double residual;  // ln f - ln t - ln E
    double per_code;  // of ln f
  };

  // Weights and residuals of one pixel's samples, with ln E their weighted mean.
  void weigh(size_t c, size_t pixel, bool robust) {
    const ChannelSamples& channel = channels_[c];
    const Curve& curve = logs_[c];
    terms_.clear();
    double sum = 0.0, weights = 0.0;
    for (size_t s = channel.first[pixel]; s < channel.first[pixel + 1]; ++s) {
      const CodeSample& sample = channel.samples[s];
      const double code = static_cast<double>(sample.code);
      const double per_code = slope_at(curve, place_of(code).knot);
      const double noise = per_code * code_noise(c, sample);
      Term term{0.0, 0.0, per_code};
      if (noise < kMostRelative) {
        term.weight = 1.0 / (noise * noise);
        term.residual = value_at(curve, code) - std::log(time_of(sample.frame));
      }
      sum += term.weight * term.residual;
      weights += term.weight;
      terms_.push_back(term);
    }
    for (Term& term : terms_) {
      if (term.weight == 0.0) continue;
      term.residual -= sum / weights;
      if (!robust) continue;
      const double off = term.residual * std::sqrt(term.weight) / kOutlier;
      const double keep = std::max(1.0 - off * off, 0.0);
      term.weight *= keep * keep;
    }
  }

  double code_noise(size_t c, const CodeSample& sample) const {
    return std::hypot(noise_[c][bin_of(sample.code)],
                      options_.alignment_sd_px * static_cast<double>(sample.gradient));
  }
  double time_of(int frame) const { return result_.exposures_s[static_cast<size_t>(frame)]; }
  static size_t bin_of(float code) {
    return static_cast<size_t>(std::clamp(static_cast<int>(code * kNoiseBins), 0, kNoiseBins - 1));
  }

  // One pixel's samples, J x + r with x the new ln f, ln E eliminated:
  // sum w J J' - (sum w J)(sum w J)' / sum w.
  void add_pixel(size_t c, size_t pixel, Eigen::MatrixXd& normal, Eigen::VectorXd& right) {
    entries_.clear();
    double weights = 0.0, offset = 0.0;
    for (size_t i = 0; i < terms_.size(); ++i) {
      const Term& term = terms_[i];
      if (term.weight == 0.0) continue;
      const CodeSample& sample = channels_[c].samples[channels_[c].first[pixel] + i];
      const Place place = place_of(static_cast<double>(sample.code));
      const int base = place.knot;
      const std::array<std::pair<int, double>, 2> row = {
          {{base, 1.0 - place.above}, {base + 1, place.above}}};
      const double constant = -std::log(time_of(sample.frame));
      for (const auto& [k, a] : row) {
        for (const auto& [l, b] : row) normal(k, l) += term.weight * a * b;
        right[k] -= term.weight * a * constant;
        entries_.emplace_back(k, term.weight * a);
      }
      weights += term.weight;
      offset += term.weight * constant;
    }
    for (const auto& [k, a] : entries_) {
      for (const auto& [l, b] : entries_) normal(k, l) -= a * b / weights;
      right[k] += a * offset / weights;
    }
  }

  // Between exposures of a constant ratio, a staircase of that ratio's steps has no residual at all, and
  // hides noise: what forbids it must grow with the samples. A power law has no cost.
  void add_smoothness(size_t c, Eigen::MatrixXd& normal) const {
    for (int k = 1; k < kKnots - 1; ++k) {
      const double above = std::max(k - options_.black_level.value_or(0.0) * kKnotsPerCode, 1.0);
      const double before = std::log((above + 1.0) / above), after = std::log((above + 2.0) / (above + 1.0));
      const Eigen::Vector3d bend(1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after);
      const double weight =
          kSmoothness * static_cast<double>(channels_[c].samples.size()) / (0.5 * (before + after));
      normal.block<3, 3>(k - 1, k - 1) += weight * bend * bend.transpose();
    }
  }

  // f(saturation) = 1.
  void hold_scale(Eigen::MatrixXd& normal) const {
    const Place place = place_of(options_.saturation);
    const int base = place.knot;
    const Eigen::Vector2d row(1.0 - place.above, place.above);
    normal.block<2, 2>(base, base) += kHold * row * row.transpose();
  }

  void solve(size_t c, bool last) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(kKnots, kKnots);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(kKnots);
    for (size_t i = 0; i + 1 < channels_[c].first.size(); ++i) {
      weigh(c, i, passes_ >= kPassesToTrust);
      add_pixel(c, i, normal, right);
    }
    add_smoothness(c, normal);
    hold_scale(normal);
    const Eigen::LLT<Eigen::MatrixXd> factors(normal);
    const Eigen::VectorXd solution = factors.solve(right);
    for (int k = 0; k < kKnots; ++k) logs_[c][static_cast<size_t>(k)] = solution[k];
    make_monotone(logs_[c], normal.diagonal());
    if (last) finish(c, factors.solve(Eigen::MatrixXd::Identity(kKnots, kKnots)));
  }

  // By the median residual of each frame: least squares over f and t together would have both flat, which
  // hides noise. Mean and slope of ln t against what is declared stay, as f and t may be raised to any power
  // together.
  void refine_times() {
    const auto n = static_cast<Eigen::Index>(declared_s_.size());
    Eigen::VectorXd declared(n), off(n);
    std::vector<std::vector<double>> residuals(declared_s_.size());
    for (size_t c = 0; c < 3; ++c) {
      for (size_t i = 0; i + 1 < channels_[c].first.size(); ++i) {
        weigh(c, i, true);
        for (size_t s = 0; s < terms_.size(); ++s) {
          if (terms_[s].weight <= 0.0) continue;
          const CodeSample& sample = channels_[c].samples[channels_[c].first[i] + s];
          residuals[static_cast<size_t>(sample.frame)].push_back(terms_[s].residual);
        }
      }
    }
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto frame = static_cast<size_t>(j);
      declared[j] = std::log(declared_s_[frame]);
      off[j] = std::log(result_.exposures_s[frame]) - declared[j];
      std::vector<double>& own = residuals[frame];
      if (own.size() < kFewest) continue;
      const auto middle = own.begin() + static_cast<std::ptrdiff_t>(own.size() / 2);
      std::nth_element(own.begin(), middle, own.end());
      off[j] += *middle;
    }
    const Eigen::VectorXd centred = (declared.array() - declared.mean()).matrix().normalized();
    off.array() -= off.mean();
    off -= centred.dot(off) * centred;
    for (Eigen::Index j = 0; j < n; ++j) {
      const double most = kMostTimeSigmas * options_.exposure_sd;
      result_.exposures_s[static_cast<size_t>(j)] = std::exp(declared[j] + std::clamp(off[j], -most, most));
    }
  }

  void finish(size_t c, const Eigen::MatrixXd& covariance) {
    Curve& curve = result_.exposures[c];
    const double top = value_at(logs_[c], options_.saturation);
    for (size_t k = 0; k < kKnots; ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      curve[k] = std::exp(logs_[c][k] - top);
      result_.errors[c][k] = curve[k] * std::sqrt(std::max(covariance(at, at), 0.0));
    }
    continue_to_black(c);
  }

  // Where noise is most of the exposure its logarithm is not fitted. From there the curve goes straight: to
  // the black level if that is known.
  void continue_to_black(size_t c) {
    Curve& curve = result_.exposures[c];
    std::array<size_t, kKnots> count{};
    for (size_t i = 0; i + 1 < channels_[c].first.size(); ++i) {
      weigh(c, i, true);
      for (size_t s = 0; s < terms_.size(); ++s) {
        const CodeSample& sample = channels_[c].samples[channels_[c].first[i] + s];
        if (terms_[s].weight > 0.0)
          ++count[static_cast<size_t>(place_of(static_cast<double>(sample.code)).knot)];
      }
    }
    size_t first = 1;
    while (first + 8 < kKnots && count[first] < kFewestAtKnot) ++first;
    double slope = (curve[first + 3] - curve[first]) / 3.0;
    if (options_.black_level) {
      const double steps = static_cast<double>(first) - *options_.black_level * kKnotsPerCode;
      if (steps > 0.0) slope = curve[first] / steps;
    }
    for (size_t k = 0; k < first; ++k) {
      curve[k] = curve[first] - slope * static_cast<double>(first - k);
      result_.errors[c][k] = std::max(result_.errors[c][first], std::abs(curve[k]));
    }
  }

  // The codes' standard deviation, by brightness: 1.4826 median |residual|, in codes, made up for what a
  // pixel's fitted E takes from its residuals.
  void learn_noise(size_t c) {
    std::array<std::vector<double>, kNoiseBins> off;
    for (size_t i = 0; i + 1 < channels_[c].first.size(); ++i) {
      weigh(c, i, false);
      double weights = 0.0;
      for (const Term& term : terms_) weights += term.weight;
      for (size_t s = 0; s < terms_.size(); ++s) {
        const Term& term = terms_[s];
        const double kept = 1.0 - term.weight / weights;
        if (term.weight == 0.0 || kept < kLeastKept) continue;
        const CodeSample& sample = channels_[c].samples[channels_[c].first[i] + s];
        const size_t bin = bin_of(sample.code);
        const double share = noise_[c][bin] / code_noise(c, sample);
        off[bin].push_back(std::abs(term.residual) / term.per_code * share / std::sqrt(kept));
      }
    }
    for (size_t bin = 0; bin < kNoiseBins; ++bin) {
      if (off[bin].size() < kFewest) continue;
      const auto middle = off[bin].begin() + static_cast<std::ptrdiff_t>(off[bin].size() / 2);
      std::nth_element(off[bin].begin(), middle, off[bin].end());
      noise_[c][bin] = std::max(1.4826 * *middle, kLeastNoise);
    }
  }

  const std::array<ChannelSamples, 3>& channels_;
  std::span<const double> declared_s_;
  const ResponseOptions& options_;
  ResponseFit result_{};
  std::array<Curve, 3> logs_{};  // ln f
  std::array<std::array<double, kNoiseBins>, 3> noise_;
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
