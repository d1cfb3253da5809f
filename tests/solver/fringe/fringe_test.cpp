// One pixel's phasors with known truth; and whole archives, valid and invalid.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/composite/compositor.h"
#include "core/footprint/faddeeva.h"
#include "core/footprint/wave_answer.h"
#include "solver/fringe/fringe_layout.h"
#include "solver/fringe/fringe_unwrap.h"
#include "solver/fringe/spectrum_fit.h"
#include "solver/methods.h"
#include "solver/worker/parallel_solve.h"
#include "tests/solver/stack_of.h"

namespace glasswing {
namespace {

using Complex = std::complex<double>;
constexpr double kPi = std::numbers::pi;

Wave wave_of(double phi_deg, double period_px) {
  Wave wave;
  wave.fx = std::cos(phi_deg * kPi / 180.0) / period_px;
  wave.fy = std::sin(phi_deg * kPi / 180.0) / period_px;
  if (std::abs(wave.fx) < 1e-9) wave.fx = 0.0;
  if (std::abs(wave.fy) < 1e-9) wave.fy = 0.0;
  return wave;
}

// 128 x 96 px.
WaveMonitor monitor() {
  WaveMonitor monitor{
      .texture = 0, .extent = {.width_px = 128.0, .height_px = 96.0}, .waves = {}, .solids = {}};
  for (const double period : {144.0, 64.0, 28.0, 12.0}) {
    monitor.waves.push_back(wave_of(0.0, period));
    monitor.waves.push_back(wave_of(90.0, period));
  }
  for (const double degrees : {45.0, -45.0}) {
    for (const double period : {32.0, 14.0}) monitor.waves.push_back(wave_of(degrees, period));
  }
  return monitor;
}

Spectrum seen(const WaveMonitor& monitor, const Footprints& modes, double sd, std::mt19937& random) {
  std::normal_distribution<double> noise(0.0, sd);
  const auto answer = [&](double fx, double fy) {
    Complex sum = 0.0;
    for (const Footprint& mode : modes) sum += answer_of(mode, fx, fy, monitor.extent).value;
    return sum;
  };
  Spectrum spectrum;
  for (const Wave& wave : monitor.waves) {
    const double re = noise(random), im = noise(random);
    spectrum.phasors.push_back({.value = answer(wave.fx, wave.fy) + Complex(re, im), .sd = sd});
  }
  spectrum.level = answer(0.0, 0.0).real() + noise(random);
  spectrum.level_sd = sd;
  return spectrum;
}

Footprints one(const Footprint& mode) {
  Footprints modes;
  modes.push_back(mode);
  return modes;
}

SpectrumFit solved(const WaveMonitor& monitor, const Spectrum& spectrum) {
  const SpectrumFitter fitter(monitor, 0.0, false);
  const Unwrapped place = unwrap(monitor, spectrum, 0.02);
  EXPECT_TRUE(place.found);
  return fitter.fit(spectrum, place.used, one(fitter.guess(spectrum, place)), 60);
}

double& parameter(Footprint& mode, size_t p) {
  double* const all[] = {&mode.weight, &mode.x_px, &mode.y_px, &mode.xx_px2, &mode.xy_px2, &mode.yy_px2};
  return *all[p];
}

// w(z) = i/pi int exp(-t^2) / (z - t) dt, by the trapezoidal rule, whose error is exp(-2 pi Im z / step).
TEST(WaveAnswer, FaddeevasFunctionIsTheIntegral) {
  for (const Complex z : {Complex(0.0, 0.7), Complex(0.3, 0.5), Complex(-1.2, 2.0), Complex(2.5, 4.0),
                          Complex(-6.0, 0.6), Complex(20.0, 1.0)}) {
    constexpr double kStep = 0.05;
    Complex sum = 0.0;
    for (int i = -160; i <= 160; ++i) {
      const double t = i * kStep;
      sum += kStep * std::exp(-t * t) / (z - t);
    }
    EXPECT_NEAR(std::abs(faddeeva(z) - Complex(0.0, 1.0 / kPi) * sum), 0.0, 1e-10) << z;
  }
  for (const double x : {0.0, 0.4, 3.0}) EXPECT_NEAR(faddeeva(x).real(), std::exp(-x * x), 1e-10);
}

// The wave on flat pixels, integrated by the compositor.
double integrated(const Footprint& f, double fx, double fy, double phase_rad) {
  RadianceImage picture(128, 96);
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 128; ++x)
      picture.at(x, y, 0) =
          static_cast<float>(std::cos(2.0 * kPi * (fx * (x + 0.5) + fy * (y + 0.5)) - phase_rad));
  }
  const Mode mode{.weight = 1.0f,
                  .x_px = static_cast<float>(f.x_px),
                  .y_px = static_cast<float>(f.y_px),
                  .xx_px2 = static_cast<float>(f.xx_px2),
                  .xy_px2 = static_cast<float>(f.xy_px2),
                  .yy_px2 = static_cast<float>(f.yy_px2)};
  return f.weight * integrate_footprint(mode, picture, 0);
}

TEST(WaveAnswer, IsTheIntegralOverFlatPixelsAndTheEdge) {
  const MonitorExtent extent{.width_px = 128.0, .height_px = 96.0};
  const Footprint inner{
      .weight = 0.7, .x_px = 50.3, .y_px = 40.6, .xx_px2 = 5.0, .xy_px2 = 2.0, .yy_px2 = 3.0},
      cut{.weight = 0.7, .x_px = 3.0, .y_px = 93.0, .xx_px2 = 16.0, .xy_px2 = 0.0, .yy_px2 = 9.0};
  for (const Footprint& mode : {inner, cut}) {
    for (const Wave& wave : monitor().waves) {
      const Complex answer = answer_of(mode, wave.fx, wave.fy, extent).value;
      // Aliases of the wave on flat pixels at frequencies 1 - f, and the cut edge: sinc(f) is part of it.
      const double tolerance = near_edge(mode, extent) ? 5e-3 : 1e-5;
      EXPECT_NEAR(answer.real(), integrated(mode, wave.fx, wave.fy, 0.0), tolerance) << 1.0 / wave.fx;
      EXPECT_NEAR(answer.imag(), integrated(mode, wave.fx, wave.fy, 0.5 * kPi), tolerance) << 1.0 / wave.fx;
    }
  }
}

TEST(WaveAnswer, SlopesAreThoseOfFiniteDifferences) {
  const MonitorExtent extent{.width_px = 128.0, .height_px = 96.0};
  // The light of the bottom edge's pixels, which slopes leave out but for R, is at most this; it falls off
  // over the footprint's width.
  const double edge = 0.7 / 12.0 * 2.0 * kPi * std::hypot(0.03, 0.04) / std::sqrt(2.0 * kPi * 5.0);
  for (const double x : {60.0, 4.0}) {
    const Footprint mode{.weight = 0.7, .x_px = x, .y_px = 91.0, .xx_px2 = 9.0, .xy_px2 = 2.0, .yy_px2 = 5.0};
    const WaveAnswer answer = answer_of(mode, 0.03, -0.04, extent);
    for (size_t p = 0; p < 6; ++p) {
      constexpr double kStep = 1e-4;  // its square times a third derivative of order 1
      Footprint less = mode, more = mode;
      parameter(less, p) -= kStep;
      parameter(more, p) += kStep;
      const Complex slope =
          (answer_of(more, 0.03, -0.04, extent).value - answer_of(less, 0.03, -0.04, extent).value) /
          (2.0 * kStep);
      EXPECT_NEAR(std::abs(slope - answer.slope[p]), 0.0, p == 0 ? 1e-7 : edge / std::sqrt(5.0))
          << p << " at " << x;
    }
  }
}

TEST(SpectrumFit, ReachesTheCramerRaoBound) {
  const WaveMonitor waves = monitor();
  const Footprint truth{
      .weight = 0.6, .x_px = 61.7, .y_px = 37.2, .xx_px2 = 6.0, .xy_px2 = 1.5, .yy_px2 = 4.0};
  constexpr double kSd = 0.004;
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  const auto add = [&](double fx, double fy, bool imaginary) {
    const WaveAnswer answer = answer_of(truth, fx, fy, waves.extent);
    Eigen::Matrix<double, 6, 1> re, im;
    for (size_t p = 0; p < 6; ++p) {
      re[p] = answer.slope[p].real();
      im[p] = answer.slope[p].imag();
    }
    information += re * re.transpose();
    if (imaginary) information += im * im.transpose();
  };
  for (const Wave& wave : waves.waves) add(wave.fx, wave.fy, true);
  add(0.0, 0.0, false);
  const Eigen::Matrix<double, 6, 6> bound = kSd * kSd * information.inverse();
  constexpr int kPixels = 2000;
  std::mt19937 random(3);
  std::array<double, 6> squares{};
  double chi_square = 0.0, weight_sd = 0.0, centre_sd = 0.0;
  for (int i = 0; i < kPixels; ++i) {
    SpectrumFit fit = solved(waves, seen(waves, one(truth), kSd, random));
    ASSERT_TRUE(fit.converged);
    Footprint expected = truth;
    for (size_t p = 0; p < 6; ++p)
      squares[p] += std::pow(parameter(fit.modes[0], p) - parameter(expected, p), 2) / kPixels;
    chi_square += fit.chi_square / fit.degrees / kPixels;
    weight_sd += fit.weight_sd[0] / kPixels;
    centre_sd += fit.centre_sd_px[0] / kPixels;
  }
  // A variance from n values has a relative error of sqrt(2 / n) = 3 %; five of that.
  const double slack = 5.0 * std::sqrt(2.0 / kPixels);
  for (size_t p = 0; p < 6; ++p) EXPECT_NEAR(squares[p] / bound(p, p), 1.0, slack) << p;
  EXPECT_NEAR(chi_square, 1.0, slack / std::sqrt(19.0));
  // Standard errors are evaluated at each fit's own result: accurate to a few percent.
  EXPECT_NEAR(weight_sd / std::sqrt(bound(0, 0)), 1.0, 0.05);
  EXPECT_NEAR(centre_sd / std::sqrt(0.5 * (bound(1, 1) + bound(2, 2))), 1.0, 0.05);
}

TEST(Unwrap, IsNeverInAnotherPeriodThanItSays) {
  const WaveMonitor waves = monitor();
  std::mt19937 random(4);
  std::uniform_real_distribution<double> x(0.0, 128.0), y(0.0, 96.0), weight(0.05, 1.0);
  int finest = 0;
  for (int i = 0; i < 20000; ++i) {
    const Footprint truth{
        .weight = weight(random), .x_px = x(random), .y_px = y(random), .xx_px2 = 1.0, .yy_px2 = 1.0};
    if (near_edge(truth, waves.extent)) continue;  // a cut footprint's light is not at its centre
    const Unwrapped place = unwrap(waves, seen(waves, one(truth), 0.03, random), 0.0);
    if (!place.found) continue;
    for (size_t w = 0; w < waves.waves.size(); ++w) {
      if (!place.used[w]) continue;
      finest += w == 6 ? 1 : 0;
      // At most half a period away; each of 240000 steps fails once in a million.
      const Eigen::Vector2d off = place.centre_px - Eigen::Vector2d(truth.x_px, truth.y_px);
      EXPECT_LT(std::abs(waves.waves[w].fx * off.x() + waves.waves[w].fy * off.y()), 0.5) << i;
    }
    // A chi-square of two degrees exceeds 36 with probability exp(-18).
    const Eigen::Vector2d off = place.centre_px - Eigen::Vector2d(truth.x_px, truth.y_px);
    EXPECT_LT(off.dot(place.covariance_px2.inverse() * off), 60.0) << i;
  }
  EXPECT_GT(finest, 1000);  // not by rejecting all
}

// Waves of 16 px and a Gray code of 16 px cells, as they show beside one another.
TEST(Unwrap, BarsTellOnePeriodFromTheNext) {
  WaveMonitor coded{.texture = 0, .extent = {.width_px = 128.0, .height_px = 96.0}, .waves = {}};
  for (const double degrees : {0.0, 90.0}) coded.waves.push_back(wave_of(degrees, 16.0));
  for (std::vector<Bars>& bars : coded.bars) {
    for (const double first_px : {64.0, 32.0, 16.0}) {
      bars.emplace_back();
      bars.back().bar_px = 2.0 * first_px;
      bars.back().offset_px = first_px;
    }
  }
  std::mt19937 random(8);
  std::uniform_real_distribution<double> x(0.0, 128.0), y(0.0, 96.0), answer(-0.1, 0.1);
  int found = 0, tried = 0;
  for (int i = 0; i < 5000; ++i) {
    const Footprint truth{.weight = 0.7, .x_px = x(random), .y_px = y(random), .xx_px2 = 0.5, .yy_px2 = 0.5};
    if (near_edge(truth, coded.extent)) continue;
    Spectrum spectrum = seen(coded, one(truth), 0.005, random);
    for (size_t axis = 0; axis < 2; ++axis) {
      const auto cell = static_cast<int>((axis == 0 ? truth.x_px : truth.y_px) / 16.0);
      for (int bit = 2; bit >= 0; --bit) {
        const double shown = ((cell ^ (cell >> 1)) >> bit & 1) != 0 ? 0.9 : -0.9;
        spectrum.bars[axis].push_back({.value = shown + answer(random), .sd = 0.02});
      }
    }
    ++tried;
    const Unwrapped place = unwrap(coded, spectrum, 0.0);
    if (!place.found) continue;
    ++found;
    EXPECT_NEAR(place.centre_px.x(), truth.x_px, 4.0) << i;  // a wrong period is 16 px off
    EXPECT_NEAR(place.centre_px.y(), truth.y_px, 4.0) << i;
  }
  EXPECT_GT(found, tried * 3 / 4);  // beside edges of bars, where one bar says nothing, some are left out
}

// Seven, eight and nine fringes along each side: no wave is as long as the monitor, their beats are.
TEST(Unwrap, BeatsTellOnePeriodFromTheNext) {
  WaveMonitor heterodyne{.texture = 0, .extent = {.width_px = 128.0, .height_px = 96.0}, .waves = {}};
  for (const double fringes : {7.0, 8.0, 9.0}) {
    heterodyne.waves.push_back(wave_of(0.0, 128.0 / fringes));
    heterodyne.waves.push_back(wave_of(90.0, 96.0 / fringes));
  }
  std::mt19937 random(9);
  std::uniform_real_distribution<double> x(0.0, 128.0), y(0.0, 96.0), noise(0.002, 0.1);
  int quiet = 0, quiet_found = 0;
  for (int i = 0; i < 20000; ++i) {
    const Footprint truth{.weight = 0.7, .x_px = x(random), .y_px = y(random), .xx_px2 = 0.5, .yy_px2 = 0.5};
    if (near_edge(truth, heterodyne.extent)) continue;
    const double sd = noise(random);
    const Unwrapped place = unwrap(heterodyne, seen(heterodyne, one(truth), sd, random), 0.0);
    // The nearest rivals, a period of 7 fringes apart, differ by 1/7 and 2/7 of a turn in 8 and 9 fringes:
    // at this noise (1/200 of a turn in each phase) far more than 4.9 standard deviations.
    const bool is_quiet = sd < 0.02;
    quiet += is_quiet ? 1 : 0;
    if (!place.found) continue;
    quiet_found += is_quiet ? 1 : 0;
    EXPECT_NEAR(place.centre_px.x(), truth.x_px, 5.0) << i << ", noise " << sd;  // a wrong period: 10 px
    EXPECT_NEAR(place.centre_px.y(), truth.y_px, 5.0) << i << ", noise " << sd;
  }
  EXPECT_GT(quiet, 1000);
  EXPECT_EQ(quiet_found, quiet);
}

TEST(SpectrumFit, TwoPlacesAreToldFromOneAndFound) {
  const WaveMonitor waves = monitor();
  std::mt19937 random(5);
  Footprints truth = one({.weight = 0.4, .x_px = 40.0, .y_px = 30.0, .xx_px2 = 2.0, .yy_px2 = 2.0});
  truth.push_back({.weight = 0.25, .x_px = 90.0, .y_px = 62.0, .xx_px2 = 3.0, .xy_px2 = 1.0, .yy_px2 = 2.0});
  const Spectrum spectrum = seen(waves, truth, 0.002, random);
  const SpectrumFitter fitter(waves, 0.0, true);
  SpectrumFit fit = fitter.fit(spectrum, std::vector<bool>(waves.waves.size(), true), one(truth[0]), 60);
  // A quarter of the light unexplained, in units of its noise.
  EXPECT_GT(fit.chi_square, 1000.0);
  fit = fitter.fit_one_more(spectrum, fit);
  ASSERT_EQ(fit.modes.size(), 2);
  EXPECT_LT(fit.chi_square, chi_square_quantile(fit.degrees, 1e-6));
  const int first = fit.modes[0].weight > fit.modes[1].weight ? 0 : 1;
  for (const int m : {0, 1}) {
    const size_t found = m == 0 ? first : 1 - first;
    const Footprint& mode = fit.modes[static_cast<int>(found)];
    EXPECT_NEAR(mode.weight, truth[m].weight, 5.0 * fit.weight_sd[found]);
    EXPECT_NEAR(mode.x_px, truth[m].x_px, 5.0 * std::sqrt(2.0) * fit.centre_sd_px[found]);
    EXPECT_NEAR(mode.y_px, truth[m].y_px, 5.0 * std::sqrt(2.0) * fit.centre_sd_px[found]);
  }
}

constexpr int kWidth = 8, kHeight = 3;

// A camera whose left half sees the object; phases, black and noise model are options.
struct Simulated {
  v1::CaptureManifest manifest;
  std::vector<Image16> frames;
  std::mt19937 random{6};

  explicit Simulated(int phases, bool black, double longest_px = 144.0, bool two_places = false) {
    v1::Camera& camera = *manifest.mutable_camera();
    camera.set_width_px(kWidth);
    camera.set_height_px(kHeight);
    camera.set_bits(16);
    if (phases == 3) camera.set_read_sd(kNoise);
    v1::Monitor& screen = *manifest.add_monitors();
    screen.set_name("back");
    screen.set_width_px(128);
    screen.set_height_px(96);
    for (const bool object : {false, true}) {
      for (const double light : {0.0, 1.0}) {
        v1::Stimulus solid;
        solid.set_kind("solid");
        solid.set_panel("back");
        for (int c = 0; c < 3; ++c) solid.add_colour(light);
        if (black) add(solid, object, two_places, [&](const Footprint&) { return light; });
      }
      for (const double phi_deg : {0.0, 90.0, 45.0, -45.0}) {
        for (const double period_px : {longest_px, 64.0, 28.0, 12.0}) {
          for (int k = 0; k < phases; ++k) {
            v1::Stimulus wave;
            wave.set_kind("sinusoid");
            wave.set_panel("back");
            wave.set_phi_deg(phi_deg);
            wave.set_period_px(period_px);
            wave.set_phase_deg(360.0 * k / phases);
            wave.set_peak(1.0);
            const Wave own = wave_of(phi_deg, period_px);
            add(wave, object, two_places, [&](const Footprint& mode) {
              const Complex answer =
                  answer_of(mode, own.fx, own.fy, {.width_px = 128.0, .height_px = 96.0}).value;
              return 0.5 * (1.0 + std::real(answer * std::polar(1.0, -2.0 * kPi * k / phases)) / mode.weight);
            });
          }
        }
      }
    }
  }

  static constexpr double kNoise = 0.002, kForeground = 0.05;
  static Footprint truth(int x, int y, bool object) {
    return {.weight = object ? 0.6 : 0.9,
            .x_px = 30.0 + 9.0 * x,
            .y_px = 25.0 + 15.0 * y,
            .xx_px2 = object ? 4.0 : 1.0,
            .xy_px2 = object ? 1.0 : 0.0,
            .yy_px2 = object ? 3.0 : 1.0};
  }

  template <typename Answer>
  void add(const v1::Stimulus& stimulus, bool object, bool two_places, Answer answer) {
    std::normal_distribution<double> noise(0.0, kNoise);
    v1::Frame& record = *manifest.add_frames();
    record.set_file("frames/" + std::to_string(manifest.frames_size()) + ".tif");
    record.set_object(object);
    *record.mutable_stimulus() = stimulus;
    Image16& frame = frames.emplace_back(kWidth, kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool own = object && x < kWidth / 2;
        const Footprint mode = truth(x, y, own);
        double light = mode.weight * answer(mode);
        if (own && two_places) light = 0.5 * light + 0.3 * answer(truth(x + 3, (y + 1) % kHeight, true));
        for (int c = 0; c < 3; ++c)
          frame.at(x, y, c) =
              code16_of(static_cast<float>(light + (own ? kForeground : 0.0) + noise(random)));
      }
    }
  }
  absl::StatusOr<Matte> solve(const MethodOptions& options = {}) const {
    return solve_in_bands(*make_method("fringe", options).value(), manifest, stack_of(manifest, frames), 1);
  }
};

void expect_truth(const Matte& matte) {
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool object = x < kWidth / 2;
      EXPECT_EQ(matte.coverage(x, y), object ? 1.0f : 0.0f) << x << " " << y;
      EXPECT_EQ(matte.flags(x, y), kFlagNone) << x << " " << y;
      const Footprint truth = Simulated::truth(x, y, object);
      for (int c = 0; c < kChannels; ++c) {
        const Mode& mode = matte.modes(x, y, c)[0];
        ASSERT_GT(mode.weight, 0.0f);
        // Five standard errors of the channel; outside, channels are fitted together.
        EXPECT_NEAR(static_cast<double>(mode.weight), truth.weight, 0.01);
        const double reach = 5.0 * std::sqrt(2.0) * static_cast<double>(mode.centre_sd_px);
        EXPECT_NEAR(static_cast<double>(mode.x_px), truth.x_px, reach);
        EXPECT_NEAR(static_cast<double>(mode.y_px), truth.y_px, reach);
        EXPECT_LT(reach, 0.5);
        // From 18 samples with noise of at least 0.002.
        EXPECT_NEAR(static_cast<double>(matte.foreground(x, y)[c]), object ? Simulated::kForeground : 0.0,
                    5.0 * Simulated::kNoise);
      }
    }
  }
}

TEST(Fringe, GivesBackTheMatteAndTheBackground) {
  expect_truth(Simulated(3, true).solve().value());
  expect_truth(Simulated(3, true, 100.0).solve().value());  // no wave is as long as the monitor
}

TEST(Fringe, MeasuresNoiseItselfAndNeedsNoBlack) {
  expect_truth(Simulated(4, true).solve().value());
  const Matte matte = Simulated(4, false).solve().value();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      EXPECT_EQ(matte.flags(x, y), kFlagNone);
      // R from the waves alone is known to 0.002; F is the mean minus half of it.
      EXPECT_NEAR(static_cast<double>(matte.foreground(x, y)[1]), Simulated::kForeground, 0.01);
    }
  }
}

TEST(Fringe, FlagsPixelsThatSeeTwoPlacesUnlessBothAreFitted) {
  const Simulated simulated(3, true, 144.0, true);
  const Matte flagged = simulated.solve().value(), fitted = simulated.solve({{"modes", "2"}}).value();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth / 2; ++x) {
      EXPECT_NE(flagged.flags(x, y) & kFlagPoorFit, 0) << x << " " << y;
      EXPECT_EQ(fitted.flags(x, y), kFlagNone) << x << " " << y;
      EXPECT_GT(fitted.modes(x, y, 1)[1].weight, 0.1f) << x << " " << y;
    }
  }
}

TEST(Fringe, SaysWhatIsMissing) {
  const auto message = [](const absl::Status& status) { return std::string(status.message()); };
  Simulated simulated(3, true);
  const absl::Status two_phases = [&] {
    v1::CaptureManifest manifest = simulated.manifest;
    manifest.mutable_frames()->DeleteSubrange(manifest.frames_size() - 1, 1);
    return lay_out_fringes(manifest).status();
  }();
  EXPECT_NE(message(two_phases).find("at 2 phases; at least 3"), std::string::npos) << two_phases;
  const absl::Status ambiguous = [&] {
    const v1::CaptureManifest manifest = Simulated(3, true, 100.0).manifest;
    // The finer ones tell its two periods apart.
    EXPECT_EQ(lay_out_fringes(manifest).status(), absl::OkStatus());
    v1::CaptureManifest alone = manifest;
    alone.clear_frames();
    for (const v1::Frame& frame : manifest.frames()) {
      if (frame.stimulus().kind() != "sinusoid" || frame.stimulus().period_px() == 100.0)
        *alone.add_frames() = frame;
    }
    return lay_out_fringes(alone).status();
  }();
  EXPECT_NE(message(ambiguous).find("along x on monitor \"back\" has a period of 100 px"), std::string::npos)
      << ambiguous;
  for (v1::Frame& frame : *simulated.manifest.mutable_frames()) {
    if (frame.stimulus().kind() == "sinusoid") frame.set_object(false);
  }
  const absl::Status none = lay_out_fringes(simulated.manifest).status();
  EXPECT_NE(message(none).find("no sinusoids"), std::string::npos) << none;
  EXPECT_TRUE(absl::IsInvalidArgument(make_method("fringe", {{"modes", "5"}}).status()));
  const absl::Status unknown = make_method("fringe", {{"speed", "5"}}).status();
  EXPECT_NE(message(unknown).find("it has: modes, silhouette_tolerance, tolerance"), std::string::npos)
      << unknown;
}

}  // namespace
}  // namespace glasswing
