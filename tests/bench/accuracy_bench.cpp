// Errors relative to the Cramer-Rao bound, and rates of found and false modes. Samples and bounds come from
// patterns summed over the monitor's pixels, not from the solver's closed form.
#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <random>

#include "tests/bench/rows.h"
#include "tests/solver/gaussian/simulated_pixel.h"

namespace glasswing {
namespace {

constexpr int kTrials = 4000;

// A monitor's pixel and the share of its light that arrives.
struct LitPixel {
  double x_px, y_px;  // its centre
  double share;
};

// The footprint integrated over each of the monitor's pixels within seven of its standard deviations, by
// Gauss and Legendre's four points a side: to 1e-7 for footprints no narrower than half a pixel.
std::vector<LitPixel> lit_pixels(const Footprint& mode) {
  constexpr std::array kAt{-0.430568156, -0.169990522, 0.169990522, 0.430568156},
      kWeight{0.173927423, 0.326072577, 0.326072577, 0.173927423};
  const double determinant = mode.xx_px2 * mode.yy_px2 - mode.xy_px2 * mode.xy_px2;
  const double peak = mode.weight / (2.0 * std::numbers::pi * std::sqrt(determinant));
  const auto range = [](double centre, double variance, double side) {
    const double reach = 7.0 * std::sqrt(variance);
    return std::pair(static_cast<int>(std::max(std::floor(centre - reach), 0.0)),
                     static_cast<int>(std::min(std::ceil(centre + reach), side)));
  };
  const auto [left, right] = range(mode.x_px, mode.xx_px2, kSimulatedExtent.width_px);
  const auto [top, bottom] = range(mode.y_px, mode.yy_px2, kSimulatedExtent.height_px);
  std::vector<LitPixel> pixels;
  for (int row = top; row < bottom; ++row) {
    for (int column = left; column < right; ++column) {
      LitPixel& pixel = pixels.emplace_back(LitPixel{column + 0.5, row + 0.5, 0.0});
      for (size_t i = 0; i < kAt.size(); ++i) {
        for (size_t j = 0; j < kAt.size(); ++j) {
          const double dx = pixel.x_px + kAt[i] - mode.x_px, dy = pixel.y_px + kAt[j] - mode.y_px;
          const double square = mode.yy_px2 * dx * dx - 2.0 * mode.xy_px2 * dx * dy + mode.xx_px2 * dy * dy;
          pixel.share += kWeight[i] * kWeight[j] * peak * std::exp(-0.5 * square / determinant);
        }
      }
    }
  }
  return pixels;
}

// The camera's answer to the stripe of every sample, as PixelSamples.y.
std::vector<double> answers(const Footprints& modes, const SampleLayout& layout) {
  std::vector<double> y(layout.padded_count(), 0.0);
  for (const Footprint& mode : modes) {
    const std::vector<LitPixel> pixels = lit_pixels(mode);
    for (const SampleLayout::Sweep& sweep : layout.sweeps) {
      for (int i = sweep.first; i < sweep.first + sweep.count; ++i) {
        const double r = sweep.first_r_px + static_cast<double>(layout.offset_px[i]);
        for (const LitPixel& pixel : pixels) {
          const double z =
              (pixel.x_px * sweep.axis.cos_phi + pixel.y_px * sweep.axis.sin_phi - r) / sweep.axis.sigma_px;
          if (std::abs(z) < 6.0) y[i] += pixel.share * std::exp(-0.5 * z * z);
        }
      }
    }
  }
  return y;
}

PixelSamples with_noise(const std::vector<double>& y, const SampleLayout& layout, double noise_sd,
                        std::mt19937& random) {
  PixelSamples samples{
      .layout = &layout, .y = std::vector(y.size(), 0.0f), .weight = std::vector(y.size(), 0.0f)};
  std::normal_distribution<double> noise(0.0, noise_sd);
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (size_t i = sweep.first; i < static_cast<size_t>(sweep.first + sweep.count); ++i)
      samples.y[i] = static_cast<float>(y[i] + noise(random)), samples.weight[i] = 1.0f;
  }
  return samples;
}

// The least standard deviation of (R, x, y, xx, xy, yy) of each mode for noise of 1: the Fisher information's
// inverse, from central differences.
Eigen::VectorXd bounds(const Footprints& truth, const SampleLayout& layout) {
  constexpr double kStep = 1e-3;
  Eigen::MatrixXd derivatives(layout.padded_count(), 6 * truth.size());
  for (int p = 0; p < derivatives.cols(); ++p) {
    Footprints up = truth, down = truth;
    parameter(up[p / 6], p % 6) += kStep;
    parameter(down[p / 6], p % 6) -= kStep;
    const std::vector<double> high = answers(up, layout), low = answers(down, layout);
    for (int i = 0; i < derivatives.rows(); ++i) derivatives(i, p) = (high[i] - low[i]) / (2.0 * kStep);
  }
  return (derivatives.transpose() * derivatives).inverse().diagonal().cwiseSqrt();
}

// Puts the modes found in the order of the nearest true ones: of up to two, that with the smaller distances.
void match(const Footprints& truth, JointFit& fit) {
  if (truth.size() < 2) return;
  const auto square = [&](int a, int b) {
    return std::pow(fit.modes[a].x_px - truth[b].x_px, 2) + std::pow(fit.modes[a].y_px - truth[b].y_px, 2);
  };
  if (square(0, 0) + square(1, 1) <= square(1, 0) + square(0, 1)) return;
  std::swap(fit.modes[0], fit.modes[1]);
  std::swap(fit.weight_sd[0], fit.weight_sd[1]);
  std::swap(fit.centre_sd_px[0], fit.centre_sd_px[1]);
}

// What a monitor shows of one pixel's channel.
struct View {
  Footprints truth;
  double sigma_px = 4.0;  // of its stripes
};

struct Configuration {
  std::string name;
  std::vector<View> views;  // one a monitor
};

struct Accuracy {
  // The largest ratios of rms error to bound, of all modes: R, c, Sigma.
  double weight = 0.0, centre = 0.0, sigma = 0.0;
  // The largest ratios of rms error to the standard error that the matte stores.
  double weight_to_stored = 0.0, centre_to_stored = 0.0;
  // Trials whose errors do not count, because on some monitor the number of modes is wrong, or the fit has
  // not converged.
  int fewer = 0, more = 0, unsettled = 0;
  int dropped() const { return fewer + more + unsettled; }
};

Accuracy measure(const Configuration& configuration, double noise_sd) {
  const size_t views = configuration.views.size();
  std::vector<SampleLayout> layouts;
  std::vector<std::vector<double>> light;
  std::vector<Eigen::ArrayXd> squares;
  std::vector<Eigen::Array2Xd> stored(views);  // sums of the variances of R and c, by mode
  for (const View& view : configuration.views) {
    layouts.push_back(four_sweeps(view.sigma_px));
    light.push_back(answers(view.truth, layouts.back()));
    squares.push_back(Eigen::ArrayXd::Zero(6 * view.truth.size()));
    stored[light.size() - 1] = Eigen::Array2Xd::Zero(2, view.truth.size());
  }
  Accuracy result;
  std::mt19937 random(21);
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<JointFit> fits;
    int missing = 0, surplus = 0;
    bool converged = true;
    for (size_t v = 0; v < views; ++v) {
      fits.push_back(solved(with_noise(light[v], layouts[v], noise_sd, random), noise_sd));
      const int difference = fits[v].modes.size() - configuration.views[v].truth.size();
      missing += difference < 0 ? 1 : 0, surplus += difference > 0 ? 1 : 0;
      converged = converged && fits[v].converged;
    }
    if (missing > 0) {
      ++result.fewer;
    } else if (surplus > 0) {
      ++result.more;
    } else if (!converged) {
      ++result.unsettled;
    } else {
      for (size_t v = 0; v < views; ++v) {
        Footprints truth = configuration.views[v].truth;
        match(truth, fits[v]);
        for (int p = 0; p < 6 * truth.size(); ++p)
          squares[v][p] +=
              std::pow(parameter(fits[v].modes[p / 6], p % 6) - parameter(truth[p / 6], p % 6), 2);
        for (int m = 0; m < truth.size(); ++m) {
          stored[v](0, m) += std::pow(fits[v].weight_sd[m], 2);
          stored[v](1, m) += std::pow(fits[v].centre_sd_px[m], 2);
        }
      }
    }
  }
  const int counted = kTrials - result.dropped();
  for (size_t v = 0; v < views; ++v) {
    const Footprints& truth = configuration.views[v].truth;
    const Eigen::ArrayXd error = (squares[v] / counted).sqrt();
    const Eigen::ArrayXd ratio = error / (noise_sd * bounds(truth, layouts[v]).array());
    for (int m = 0; m < truth.size(); ++m) {
      result.weight = std::max(result.weight, ratio[6 * m]);
      result.centre = std::max(result.centre, ratio.segment(6 * m + 1, 2).maxCoeff());
      result.sigma = std::max(result.sigma, ratio.segment(6 * m + 3, 3).maxCoeff());
      const double centre = 0.5 * squares[v].segment(6 * m + 1, 2).sum();  // rms of x and y, as stored
      result.weight_to_stored =
          std::max(result.weight_to_stored, std::sqrt(squares[v][6 * m] / stored[v](0, m)));
      result.centre_to_stored = std::max(result.centre_to_stored, std::sqrt(centre / stored[v](1, m)));
    }
  }
  return result;
}

Footprints modes(std::initializer_list<Footprint> list) {
  Footprints all;
  for (const Footprint& mode : list) all.push_back(mode);
  return all;
}

// The bound is that of an unbiased estimate; 4000 trials find a ratio to 1.1 %. Two modes are searched for,
// and some pixels' choice of starts costs accuracy.
std::vector<Configuration> configurations() {
  const Footprint one{.weight = 0.7, .x_px = 61.3, .y_px = 44.8, .xx_px2 = 6.0, .xy_px2 = 1.5, .yy_px2 = 4.0};
  const Footprint far{.weight = 0.4, .x_px = 96.5, .y_px = 20.0, .xx_px2 = 6.0, .xy_px2 = 1.5, .yy_px2 = 4.0};
  const Footprint narrow{
      .weight = 0.7, .x_px = 61.3, .y_px = 44.8, .xx_px2 = 1.2, .xy_px2 = 0.0, .yy_px2 = 1.2};
  const Footprint broad{
      .weight = 0.7, .x_px = 61.3, .y_px = 44.8, .xx_px2 = 64.0, .xy_px2 = 0.0, .yy_px2 = 36.0};
  const Footprint slanted{
      .weight = 0.7, .x_px = 61.3, .y_px = 44.8, .xx_px2 = 20.0, .xy_px2 = 15.0, .yy_px2 = 14.0};
  const Footprint cut{.weight = 0.7, .x_px = 4.0, .y_px = 44.8, .xx_px2 = 9.0, .xy_px2 = 3.0, .yy_px2 = 6.0};
  // 3.2 response widths from `one`: sigma_r is at most 4.8 px in these sweeps.
  Footprint other = one;
  other.weight = 0.5, other.x_px += 11.0, other.y_px += 11.0;
  return {{"one mode", {{modes({one})}}},
          {"one mode elsewhere", {{modes({far})}}},
          {"one narrow mode", {{modes({narrow})}}},
          {"one broad mode", {{modes({broad})}}},
          {"one slanted mode", {{modes({slanted})}}},
          {"one mode that an edge cuts", {{modes({cut})}}},
          {"a mode on each of two monitors", {{modes({one})}, {modes({far}), 6.0}}},
          {"two modes 3.2 sigma apart", {{modes({one, other})}}}};
}

// Two modes of the width 2 px, two response widths apart in any direction.
Footprints random_modes(int count, std::mt19937& random) {
  std::uniform_real_distribution<double> angle(0.0, 2.0 * std::numbers::pi), place(-1.0, 1.0);
  const double turn = angle(random), apart = 2.0 * std::sqrt(16.0 + 4.0 + kFlatPixel_px2);
  Footprints all;
  for (int m = 0; m < count; ++m) {
    const double side = m - 0.5 * (count - 1);
    all.push_back({.weight = 0.8 / count,
                   .x_px = 60.0 + place(random) + side * apart * std::cos(turn),
                   .y_px = 48.0 + place(random) + side * apart * std::sin(turn),
                   .xx_px2 = 4.0,
                   .xy_px2 = 0.0,
                   .yy_px2 = 4.0});
  }
  return all;
}

// In % of pixels.
struct Detection {
  double both = 0.0;   // two modes of two, each nearer to its own place than a quarter of their distance
  double count = 0.0;  // two modes of two, anywhere
  double false_second = 0.0;
};

Detection detection(double noise_sd) {
  constexpr int kPlaces = 400;
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(22);
  Detection found;
  for (int place = 0; place < kPlaces; ++place) {
    for (const int count : {1, 2}) {
      const Footprints truth = random_modes(count, random);
      const std::vector<double> y = answers(truth, layout);
      for (int i = 0; i < kTrials / kPlaces; ++i) {
        JointFit fit = solved(with_noise(y, layout, noise_sd, random), noise_sd);
        if (count == 1 || fit.modes.size() != 2) {
          found.false_second += count == 1 && fit.modes.size() > 1 ? 1.0 : 0.0;
          continue;
        }
        match(truth, fit);
        const double apart = std::hypot(truth[1].x_px - truth[0].x_px, truth[1].y_px - truth[0].y_px);
        bool right = true;
        for (int m = 0; m < 2; ++m) {
          const double away =
              std::hypot(fit.modes[m].x_px - truth[m].x_px, fit.modes[m].y_px - truth[m].y_px);
          right = right && away < 0.25 * apart;
        }
        found.count += 1.0;
        found.both += right ? 1.0 : 0.0;
      }
    }
  }
  for (double* share : {&found.both, &found.count, &found.false_second}) *share *= 100.0 / kTrials;
  return found;
}

// Measures at the first call, once for several rows.
template <class Function>
auto once(Function function) {
  auto kept = std::make_shared<std::optional<decltype(function())>>();
  return [kept, function] {
    if (!*kept) *kept = function();
    return **kept;
  };
}

}  // namespace

void add_accuracy_rows(std::vector<Row>& rows) {
  for (const Configuration& configuration : configurations()) {
    const auto accuracy = once([configuration] { return measure(configuration, 0.005); });
    const std::string figure = configuration.name + ", 0.5 % noise: ";
    rows.push_back({figure + "error over the Cramer-Rao bound", "x", {}, [=](const Rates&) {
                      const Accuracy all = accuracy();
                      return std::max({all.weight, all.centre, all.sigma});
                    }});
    rows.push_back({figure + "trials dropped", "%", {}, [=](const Rates&) {
                      const Accuracy all = accuracy();
                      fmt::print(
                          "{}of {} trials dropped: {} with fewer modes, {} with more, {} not converged\n"
                          "  error over the bound: weight {:.3f}, centre {:.3f}, Sigma {:.3f}; over the "
                          "stored standard error: weight {:.3f}, centre {:.3f}\n",
                          figure, kTrials, all.fewer, all.more, all.unsettled, all.weight, all.centre,
                          all.sigma, all.weight_to_stored, all.centre_to_stored);
                      return 100.0 * all.dropped() / kTrials;
                    }});
  }
  const auto found = once([] { return detection(0.01); });
  rows.push_back({"two modes 2 sigma apart, 1 % noise: both found", "% of pixels", {}, [=](const Rates&) {
                    const Detection all = found();
                    fmt::print("two modes 2 sigma apart: two found in {:.1f} %\n", all.count);
                    return all.both;
                  }});
  rows.push_back({"one mode, 1 % noise: a false second one", "% of pixels", {}, [=](const Rates&) {
                    return found().false_second;
                  }});
}

}  // namespace glasswing
