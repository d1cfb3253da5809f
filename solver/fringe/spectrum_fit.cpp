#include "solver/fringe/spectrum_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

using Complex = std::complex<double>;
constexpr double kPi = std::numbers::pi;
constexpr double kLeastVariance_px2 = 1e-6;  // narrower footprints are points, as far as an edge is concerned
constexpr double kMostTurn = 12.0;           // of complex_erf: such a wave is gone, e^-144
constexpr int kMostSteps = 40;
constexpr Eigen::Index kParameters = 6;

double sinc(double t) {
  return t == 0.0 ? 1.0 : std::sin(kPi * t) / (kPi * t);
}

// \int_0^extent of the Gaussian of this variance and complex mean, and its slopes.
struct Part {
  Complex value{1.0, 0.0}, by_mean, by_variance;
};

Part part_within(Complex mean, double variance, double extent) {
  const double v = std::max(variance, kLeastVariance_px2), scale = 1.0 / std::sqrt(2.0 * v);
  if (std::abs(mean.imag()) * scale > kMostTurn) return {};
  const auto density = [&](double t) {
    return std::exp(-(t - mean) * (t - mean) / (2.0 * v)) / std::sqrt(2.0 * kPi * v);
  };
  const Complex low = density(0.0), high = density(extent);
  return {.value = 0.5 * (complex_erf((extent - mean) * scale) - complex_erf(-mean * scale)),
          .by_mean = low - high,
          .by_variance = -0.5 * (low * mean + high * (extent - mean)) / v};
}

}  // namespace

Complex complex_erf(Complex z) {
  const double x = z.real(), y = z.imag();
  const double fall = std::exp(-x * x);
  Complex sum = std::erf(x);
  if (y == 0.0) return sum;
  const double cos2xy = std::cos(2.0 * x * y), sin2xy = std::sin(2.0 * x * y);
  sum += std::abs(x) < 1e-9 ? Complex(0.0, y / kPi) : fall / (2.0 * kPi * x) * Complex(1.0 - cos2xy, sin2xy);
  const int terms = static_cast<int>(2.0 * std::abs(y)) + 14;
  Complex series = 0.0;
  for (int n = 1; n <= terms; ++n) {
    const double up = std::exp(n * y - 0.25 * n * n), down = std::exp(-n * y - 0.25 * n * n);
    const double cosh_ny = 0.5 * (up + down), sinh_ny = 0.5 * (up - down), flat = std::exp(-0.25 * n * n);
    series += Complex(2.0 * x * flat - 2.0 * x * cosh_ny * cos2xy + n * sinh_ny * sin2xy,
                      2.0 * x * cosh_ny * sin2xy + n * sinh_ny * cos2xy) /
              (n * n + 4.0 * x * x);
  }
  return sum + 2.0 / kPi * fall * series;
}

Answer answer_of(const Footprint& mode, double fx, double fy, const MonitorExtent& extent) {
  const double turned = fx * fx * mode.xx_px2 + 2.0 * fx * fy * mode.xy_px2 + fy * fy * mode.yy_px2;
  const Complex unit =
      sinc(fx) * sinc(fy) *
      std::exp(Complex(-2.0 * kPi * kPi * turned, 2.0 * kPi * (fx * mode.x_px + fy * mode.y_px)));
  const Complex ix(0.0, 2.0 * kPi * fx), iy(0.0, 2.0 * kPi * fy);
  Part x, y;
  if (near_edge(mode, extent)) {
    x = part_within(mode.x_px + ix * mode.xx_px2 + iy * mode.xy_px2, mode.xx_px2, extent.width_px);
    y = part_within(mode.y_px + ix * mode.xy_px2 + iy * mode.yy_px2, mode.yy_px2, extent.height_px);
  }
  const Complex both = unit * x.value * y.value;
  const Complex edge_x = mode.weight * unit * x.by_mean * y.value,
                edge_y = mode.weight * unit * x.value * y.by_mean;
  const Complex whole = mode.weight * both;
  return {.value = whole,
          .slope = {both, whole * ix + edge_x, whole * iy + edge_y,
                    0.5 * whole * ix * ix + edge_x * ix + mode.weight * unit * x.by_variance * y.value,
                    whole * ix * iy + edge_x * iy + edge_y * ix,
                    0.5 * whole * iy * iy + edge_y * iy + mode.weight * unit * x.value * y.by_variance}};
}

// J'J, J'r and r'r over what is measured.
struct SpectrumFitter::Normal {
  Eigen::MatrixXd matrix;
  Eigen::VectorXd gradient;
  double cost = 0.0, tolerated = 0.0;
  int count = 0;

  explicit Normal(Eigen::Index size) : matrix(size, size), gradient(size) {
    matrix.setZero();
    gradient.setZero();
  }
  void add(const Eigen::VectorXd& slope, double left, double variance, double tolerance) {
    matrix.selfadjointView<Eigen::Lower>().rankUpdate(slope, 1.0 / variance);
    gradient += slope * (left / variance);
    cost += left * left / variance;
    tolerated += left * left / (variance + tolerance * tolerance);
    ++count;
  }
};

SpectrumFitter::Normal SpectrumFitter::normal_at(const Spectrum& spectrum,
                                                 const std::vector<bool>& phase_known,
                                                 const Footprints& modes) const {
  const Eigen::Index size = kParameters * modes.size();
  Normal normal(size);
  Eigen::VectorXd re(size), im(size);
  double light = 0.0;
  for (const Footprint& mode : modes) light += mode.weight;
  const double tolerance = tolerance_ * light;
  const auto answer = [&](double fx, double fy) {
    Complex sum = 0.0;
    Eigen::Index at = 0;
    for (const Footprint& mode : modes) {
      const Answer own = answer_of(mode, fx, fy, monitor_.extent);
      sum += own.value;
      for (const Complex& slope : own.slope) {
        re[at] = slope.real();
        im[at++] = slope.imag();
      }
    }
    return sum;
  };
  if (std::isfinite(spectrum.level_sd)) {
    const Complex model = answer(0.0, 0.0);
    normal.add(re, spectrum.level - model.real(), spectrum.level_sd * spectrum.level_sd, tolerance);
  }
  for (size_t w = 0; w < monitor_.waves.size(); ++w) {
    const Phasor& phasor = spectrum.phasors[w];
    if (!std::isfinite(phasor.sd)) continue;
    const Complex model = answer(monitor_.waves[w].fx, monitor_.waves[w].fy);
    const double variance = phasor.sd * phasor.sd;
    if (phase_known[w]) {
      normal.add(re, phasor.value.real() - model.real(), variance, tolerance);
      normal.add(im, phasor.value.imag() - model.imag(), variance, tolerance);
      continue;
    }
    const double size_model = std::abs(model);
    // Noise lengthens a phasor; below it there is nothing to tell but that it is short.
    const double seen = std::sqrt(std::max(std::norm(phasor.value) - variance, 0.0));
    if (size_model > 0.0) re = (model.real() * re + model.imag() * im) / size_model;
    normal.add(re, seen - size_model, variance, tolerance);
  }
  normal.matrix = normal.matrix.selfadjointView<Eigen::Lower>();
  return normal;
}

Footprint SpectrumFitter::guess(const Spectrum& spectrum, const Unwrapped& unwrapped) const {
  // ln |H| - ln sinc = ln R - 2 pi^2 f' Sigma f; each weighs by |H|^2 / variance. The little that holds Sigma
  // where nothing else does says about a pixel.
  Eigen::Matrix4d matrix = Eigen::Vector4d(0.0, 1e-6, 1e-6, 1e-6).asDiagonal();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  const auto add = [&](double fx, double fy, double size, double sd) {
    if (!(size > 3.0 * sd)) return;
    const Eigen::Vector4d row = Eigen::Vector4d(1.0, -2.0 * kPi * kPi * fx * fx, -4.0 * kPi * kPi * fx * fy,
                                                -2.0 * kPi * kPi * fy * fy);
    const double weight = size * size / (sd * sd);
    matrix += weight * row * row.transpose();
    right += weight * row * std::log(size / (sinc(fx) * sinc(fy)));
  };
  if (std::isfinite(spectrum.level_sd)) add(0.0, 0.0, spectrum.level, spectrum.level_sd);
  for (size_t w = 0; w < monitor_.waves.size(); ++w) {
    const Phasor& phasor = spectrum.phasors[w];
    if (std::isfinite(phasor.sd))
      add(monitor_.waves[w].fx, monitor_.waves[w].fy, std::abs(phasor.value), phasor.sd);
  }
  const Eigen::Vector4d found = matrix.ldlt().solve(right);
  return with_positive_covariance({.weight = std::exp(found[0]),
                                   .x_px = unwrapped.centre_px.x(),
                                   .y_px = unwrapped.centre_px.y(),
                                   .xx_px2 = found[1],
                                   .xy_px2 = found[2],
                                   .yy_px2 = found[3]},
                                  0.0);
}

SpectrumFit SpectrumFitter::fit(const Spectrum& spectrum, const std::vector<bool>& phase_known,
                                const Footprints& start) const {
  SpectrumFit result{.modes = start};
  const bool oblique = std::ranges::any_of(monitor_.waves, [](const Wave& w) { return w.fx * w.fy != 0.0; });
  const Eigen::Index size = kParameters * start.size();
  // What no wave tells of stays as it is.
  const auto hold = [&](Eigen::MatrixXd& matrix) {
    for (Eigen::Index m = 0; !oblique && m < start.size(); ++m) {
      const Eigen::Index xy = kParameters * m + 4;
      matrix.row(xy).setZero();
      matrix.col(xy).setZero();
      matrix(xy, xy) = 1.0;
    }
  };
  Normal normal = normal_at(spectrum, phase_known, result.modes);
  double damping = 1e-3;
  for (int step = 0; step < kMostSteps && !result.converged; ++step) {
    Eigen::MatrixXd damped = normal.matrix;
    hold(damped);
    damped.diagonal() *= 1.0 + damping;
    damped.diagonal().array() += 1e-12;
    const Eigen::LDLT<Eigen::MatrixXd> solver(damped);
    Eigen::VectorXd gradient = normal.gradient;
    if (!oblique) {
      for (Eigen::Index m = 0; m < start.size(); ++m) gradient[kParameters * m + 4] = 0.0;
    }
    Eigen::VectorXd change = solver.solve(gradient);
    Footprints next = result.modes;
    Eigen::Index at = 0;
    bool bounded = false;
    Eigen::VectorXd bound = Eigen::VectorXd::Zero(size);  // how far Sigma goes
    for (Footprint& mode : next) {
      mode.xx_px2 += change[at + 3];
      mode.xy_px2 += change[at + 4];
      mode.yy_px2 += change[at + 5];
      const Footprint inside = with_positive_covariance(mode, 0.0);
      bound.segment(at + 3, 3) = change.segment(at + 3, 3) + Eigen::Vector3d(inside.xx_px2 - mode.xx_px2,
                                                                             inside.xy_px2 - mode.xy_px2,
                                                                             inside.yy_px2 - mode.yy_px2);
      bounded = bounded || !bound.segment(at + 3, 3).isApprox(change.segment(at + 3, 3));
      mode = inside;
      at += kParameters;
    }
    if (bounded) {
      // The other parameters follow.
      Eigen::MatrixXd others = damped;
      Eigen::VectorXd left = gradient - damped * bound;
      for (Eigen::Index i = 0; i < size; ++i) {
        if (i % kParameters < 3) continue;
        others.row(i).setZero();
        others.col(i).setZero();
        others(i, i) = 1.0;
        left[i] = 0.0;
      }
      change = bound + others.ldlt().solve(left);
    }
    at = 0;
    for (Footprint& mode : next) {
      mode.weight = std::max(mode.weight + change[at], 0.0);
      mode.x_px += change[at + 1];
      mode.y_px += change[at + 2];
      at += kParameters;
    }
    const Normal there = normal_at(spectrum, phase_known, next);
    const double promised = 2.0 * change.dot(gradient) - change.dot(normal.matrix * change);
    if (there.cost <= normal.cost) {
      result.converged = normal.cost - there.cost < 1e-2 + 1e-6 * normal.cost;
      result.modes = next;
      normal = there;
      damping = std::max(0.1 * damping, 1e-9);
    } else {
      result.converged = std::abs(promised) < 1e-2 + 1e-6 * normal.cost;
      damping *= 8.0;
    }
  }
  result.chi_square = normal.cost;
  result.tolerated = normal.tolerated;
  result.degrees = normal.count - static_cast<int>(size) + (oblique ? 0 : start.size());
  hold(normal.matrix);
  const Eigen::MatrixXd inverse =
      normal.matrix.selfadjointView<Eigen::Lower>().ldlt().solve(Eigen::MatrixXd::Identity(size, size));
  for (int m = 0; m < result.modes.size(); ++m) {
    const Eigen::Index at = kParameters * m;
    const auto sd = [](double variance) { return variance > 0.0 ? std::sqrt(variance) : kUnknown; };
    result.weight_sd[static_cast<size_t>(m)] = sd(inverse(at, at));
    result.centre_sd_px[static_cast<size_t>(m)] =
        sd(0.5 * (inverse(at + 1, at + 1) + inverse(at + 2, at + 2)));
  }
  return result;
}

}  // namespace glasswing
