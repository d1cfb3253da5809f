#include "core/radiometry/tone_curve.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

namespace glasswing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr size_t kMinCodes = 6;
constexpr double kFall = 0.005;      // of full scale: the accuracy that a response needs
constexpr double kFallErrors = 4.0;  // standard
constexpr double kMinGamma = 0.5, kMaxGamma = 4.0;
constexpr double kGammaStep = 0.1;
// Powers of ten of tau^2, for weights of mean 1 and lights of full scale 1.
constexpr int kMinRoughness = -4, kMaxRoughness = 10;

double covariance(double x, double y) {
  const double m = std::min(x, y);
  return x * y + m * m * (m / 3.0 + std::abs(x - y) / 2.0);
}

MatrixXd covariances(const VectorXd& x, const VectorXd& y) {
  return MatrixXd::NullaryExpr(x.size(), y.size(),
                               [&](Eigen::Index i, Eigen::Index j) { return covariance(x[i], y[j]); });
}

MatrixXd power_law(const VectorXd& x, double gamma) {
  MatrixXd columns(x.size(), 2);
  columns.col(0).setOnes();
  columns.col(1) = x.array().pow(gamma);
  return columns;
}

// Derivatives of the light with respect to b, a and (in units of 1 / a) gamma.
MatrixXd tangents(const VectorXd& x, double gamma) {
  MatrixXd columns(x.size(), 3);
  columns.leftCols(2) = power_law(x, gamma);
  columns.col(2) = columns.col(1).array() * x.array().max(1e-12).log();
  return columns;
}

// The fit for one gamma and one tau.
struct Model {
  double gamma = 0.0, roughness = 0.0;  // tau^2
  double log_likelihood = 0.0;          // restricted
  double variance = 0.0;                // sigma^2
  Eigen::LLT<MatrixXd> noise;           // of the points, in units of sigma^2: W + tau^2 K
  Eigen::Matrix2d information;          // of b and a, in units of 1 / sigma^2
  Eigen::Vector2d law;                  // b and a
  VectorXd rest;                        // noise^-1 (y - b - a x^gamma)
};

struct Points {
  VectorXd x, light, weight;  // weight: w
  MatrixXd process;           // K
};

std::optional<Model> fitted(const Points& points, double gamma, double roughness) {
  Model model;
  model.gamma = gamma;
  model.roughness = roughness;
  MatrixXd noise = roughness * points.process;
  noise.diagonal() += points.weight;
  model.noise.compute(noise);
  if (model.noise.info() != Eigen::Success) return std::nullopt;
  const MatrixXd columns = power_law(points.x, gamma);
  const MatrixXd solved = model.noise.solve(columns);
  model.information = columns.transpose() * solved;
  model.law = model.information.ldlt().solve(solved.transpose() * points.light);
  const VectorXd residual = points.light - columns * model.law;
  model.rest = model.noise.solve(residual);
  const auto freedom = static_cast<double>(points.x.size() - 2);
  model.variance = std::max(residual.dot(model.rest) / freedom, 1e-18);
  const double log_determinant = 2.0 * MatrixXd(model.noise.matrixL()).diagonal().array().log().sum();
  model.log_likelihood = -0.5 * (freedom * std::log(model.variance) + log_determinant +
                                 std::log(model.information.determinant()));
  return model;
}

std::optional<Model> likeliest(const Points& points) {
  std::optional<Model> best;
  const auto try_one = [&](double gamma, double roughness) {
    std::optional<Model> model = fitted(points, gamma, roughness);
    if (model && (!best || model->log_likelihood > best->log_likelihood)) best = std::move(model);
  };
  for (double gamma = kMinGamma; gamma <= kMaxGamma; gamma += kGammaStep) {
    try_one(gamma, 0.0);
    for (int power = kMinRoughness; power <= kMaxRoughness; ++power) try_one(gamma, std::pow(10.0, power));
  }
  if (!best) return best;
  double gamma_step = kGammaStep, factor = 10.0;
  for (int halving = 0; halving < 10; ++halving) {
    gamma_step *= 0.5;
    factor = std::sqrt(factor);
    const double gamma = best->gamma, roughness = best->roughness;
    for (const double g : {gamma - gamma_step, gamma, gamma + gamma_step}) {
      for (const double r : {roughness / factor, roughness, roughness * factor}) try_one(g, r);
    }
  }
  return best;
}

// Replaces the values by the nearest non-decreasing ones (pooling of adjacent violators).
void pool_falls(VectorXd& values) {
  struct Step {
    double sum;
    Eigen::Index count;
    double mean() const { return sum / static_cast<double>(count); }
  };
  std::vector<Step> steps;
  for (const double value : values) {
    steps.push_back({value, 1});
    while (steps.size() > 1 && steps[steps.size() - 2].mean() > steps.back().mean()) {
      const Step last = steps.back();
      steps.pop_back();
      steps.back() = {steps.back().sum + last.sum, steps.back().count + last.count};
    }
  }
  Eigen::Index at = 0;
  for (const Step& step : steps) {
    values.segment(at, step.count).setConstant(step.mean());
    at += step.count;
  }
}

// Sorted by code, each code once: several lights of a code become their weighted mean.
std::vector<TonePoint> merged(std::vector<TonePoint> points) {
  std::stable_sort(points.begin(), points.end(),
                   [](const TonePoint& a, const TonePoint& b) { return a.code < b.code; });
  std::vector<TonePoint> codes;
  for (auto from = points.begin(); from != points.end();) {
    const auto to =
        std::find_if(from, points.end(), [&](const TonePoint& p) { return p.code != from->code; });
    double sum = 0.0, weights = 0.0;
    for (auto point = from; point != to; ++point) {
      const double weight = point->error > 0.0 ? 1.0 / (point->error * point->error) : 1.0;
      sum += weight * point->light;
      weights += weight;
    }
    codes.push_back({from->code, sum / weights, from->error > 0.0 ? 1.0 / std::sqrt(weights) : 0.0});
    from = to;
  }
  return codes;
}

absl::Status check(const std::vector<TonePoint>& points, int highest, std::string_view what) {
  const bool errors = !points.empty() && points.front().error > 0.0;
  for (const TonePoint& point : points) {
    if (point.code < 0 || point.code > highest || !std::isfinite(point.light) ||
        !std::isfinite(point.error) || (point.error > 0.0) != errors || point.error < 0.0) {
      return absl::InvalidArgumentError(fmt::format(
          "{}: code {} has light {} +- {}; codes go from 0 to {}, and errors are positive, or 0 at "
          "all codes",
          what, point.code, point.light, point.error, highest));
    }
  }
  return absl::OkStatus();
}

absl::Status check_rise(const std::vector<TonePoint>& codes, int highest, std::string_view what) {
  if (codes.size() < kMinCodes || codes.front().code != 0 || codes.back().code != highest) {
    return absl::FailedPreconditionError(fmt::format(
        "{}: too few grays: {} different codes from {} to {}; it takes {} or more, 0 and {} among them", what,
        codes.size(), codes.empty() ? 0 : codes.front().code, codes.empty() ? 0 : codes.back().code,
        kMinCodes, highest));
  }
  const double swing = codes.back().light - codes.front().light;
  if (!(swing > kFallErrors * std::hypot(codes.front().error, codes.back().error))) {
    return absl::FailedPreconditionError(fmt::format(
        "{}: no light is seen: code {} is no brighter than code 0 ({:.4g} and {:.4g}); the monitor "
        "must be in the camera's view and bright enough for the exposure",
        what, highest, codes.back().light, codes.front().light));
  }
  TonePoint brightest = codes.front();
  for (const TonePoint& point : codes) {
    const double fall = brightest.light - point.light;
    if (fall > std::max(kFall * swing, kFallErrors * std::hypot(brightest.error, point.error))) {
      return absl::FailedPreconditionError(fmt::format(
          "{}: code {} is darker than code {}, by {:.1f} % of full scale, which is more than noise; "
          "is auto exposure on, or does the light flicker?",
          what, point.code, brightest.code, 100.0 * fall / swing));
    }
    if (point.light > brightest.light) brightest = point;
  }
  return absl::OkStatus();
}

// The points with codes and lights scaled to [0, 1], and weights to a mean of 1.
Points normalised(const std::vector<TonePoint>& codes, int highest) {
  const double black = codes.front().light, swing = codes.back().light - black;
  const auto count = static_cast<Eigen::Index>(codes.size());
  Points points{.x = VectorXd(count), .light = VectorXd(count), .weight = VectorXd(count), .process = {}};
  for (Eigen::Index i = 0; i < count; ++i) {
    const TonePoint& point = codes[i];
    points.x[i] = point.code / static_cast<double>(highest);
    points.light[i] = (point.light - black) / swing;
    points.weight[i] = point.error > 0.0 ? point.error * point.error : 1.0;
  }
  points.weight /= points.weight.mean();
  points.process = covariances(points.x, points.x);
  return points;
}

}  // namespace

absl::StatusOr<ToneCurve> ToneCurve::create(std::vector<double> radiances) {
  const size_t count = radiances.size();
  if (count < 256 || count > 4096 || (count & (count - 1)) != 0) {
    return absl::InvalidArgumentError(
        fmt::format("a response of {} codes; 256, 512, 1024, 2048 or 4096 can be used", count));
  }
  for (size_t k = 1; k < count; ++k) {
    if (!(radiances[k] >= radiances[k - 1])) {
      return absl::InvalidArgumentError(
          fmt::format("a response falls from {} at code {} to {} at code {}; it must not fall",
                      radiances[k - 1], k - 1, radiances[k], k));
    }
  }
  if (radiances.front() != 0.0 || radiances.back() != 1.0) {
    return absl::InvalidArgumentError(fmt::format("a response goes from {} to {}; it must go from 0 to 1",
                                                  radiances.front(), radiances.back()));
  }
  return ToneCurve(std::move(radiances));
}

ToneCurve ToneCurve::power(double exponent, int bits) {
  std::vector<double> radiances(size_t{1} << bits);
  for (size_t k = 0; k < radiances.size(); ++k)
    radiances[k] = std::pow(static_cast<double>(k) / static_cast<double>(radiances.size() - 1), exponent);
  return ToneCurve(std::move(radiances));
}

double ToneCurve::radiance(double code) const {
  const double inside = std::clamp(code, 0.0, static_cast<double>(highest_code()));
  const auto k = std::min(static_cast<size_t>(inside), radiances_.size() - 2);
  return std::lerp(radiances_[k], radiances_[k + 1], inside - static_cast<double>(k));
}

double ToneCurve::code_for(double radiance) const {
  if (!(radiance > 0.0)) return 0.0;
  if (radiance >= 1.0) radiance = 1.0;
  const auto above = std::lower_bound(radiances_.begin(), radiances_.end(), radiance);
  const double low = *(above - 1);
  return static_cast<double>(above - radiances_.begin() - 1) + (radiance - low) / (*above - low);
}

absl::StatusOr<ToneFit> fit_tone_curve(std::vector<TonePoint> measured, int bits, std::string_view what) {
  if (bits < 8 || bits > 12) {
    return absl::InvalidArgumentError(fmt::format("codes have {} bits; it must be 8 to 12", bits));
  }
  const int highest = (1 << bits) - 1;
  absl::Status status = check(measured, highest, what);
  if (!status.ok()) return status;
  const std::vector<TonePoint> codes = merged(std::move(measured));
  status = check_rise(codes, highest, what);
  if (!status.ok()) return status;

  const double swing = codes.back().light - codes.front().light;
  const Points points = normalised(codes, highest);
  const std::optional<Model> model = likeliest(points);
  if (!model) {
    return absl::FailedPreconditionError(
        fmt::format("{}: no curve fits: the lights' errors differ too much from one another", what));
  }

  const VectorXd all = VectorXd::LinSpaced(highest + 1, 0.0, 1.0);
  const MatrixXd columns = power_law(all, model->gamma);
  const MatrixXd process = model->roughness * covariances(all, points.x);
  VectorXd light = columns * model->law + process * model->rest;
  const VectorXd left = points.light - power_law(points.x, model->gamma) * model->law -
                        model->roughness * points.process * model->rest;
  pool_falls(light);
  const double full_scale = light[highest] - light[0];
  if (!(full_scale > 0.0)) {
    return absl::FailedPreconditionError(fmt::format("{}: no light is seen over the noise", what));
  }
  std::vector<double> radiances(static_cast<size_t>(highest) + 1), error(radiances.size());
  for (int k = 0; k <= highest; ++k) radiances[k] = (light[k] - light[0]) / full_scale;
  radiances.back() = 1.0;

  // Universal kriging with gamma as an additional unknown: radiance is a ratio of the light at three codes,
  // so its variance follows from their covariance.
  const MatrixXd at_points = tangents(points.x, model->gamma);
  const MatrixXd solved = model->noise.solve(at_points);
  const MatrixXd drift = tangents(all, model->gamma) - process * solved;
  const MatrixXd seen = model->noise.matrixL().solve(process.transpose());
  const Eigen::Matrix3d law = (at_points.transpose() * solved).inverse();
  const auto joint = [&](int j, int k) {
    return model->roughness * covariance(all[j], all[k]) - seen.col(j).dot(seen.col(k)) +
           drift.row(j) * law * drift.row(k).transpose();
  };
  for (int k = 0; k <= highest; ++k) {
    const double l = radiances[k];
    const std::array<std::pair<int, double>, 3> terms{{{k, 1.0}, {0, l - 1.0}, {highest, -l}}};
    double variance = 0.0;
    for (const auto& [i, a] : terms) {
      for (const auto& [j, b] : terms) variance += a * b * joint(i, j);
    }
    error[k] = std::sqrt(std::max(variance * model->variance, 0.0)) / full_scale;
  }
  absl::StatusOr<ToneCurve> curve = ToneCurve::create(std::move(radiances));
  if (!curve.ok()) return curve.status();
  return ToneFit{
      .curve = *std::move(curve),
      .gamma = model->gamma,
      .full_scale = full_scale * swing,
      .residual_rms = std::sqrt(left.squaredNorm() / static_cast<double>(codes.size())) / full_scale,
      .error = std::move(error)};
}

}  // namespace glasswing
