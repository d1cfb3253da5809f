// Compares one- and two-Gaussian fits with Ceres on the same windows, and with the Cramer-Rao bound.
#include "solver/gaussian/kernels/line_fit.h"

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "solver/gaussian/peaks.h"

namespace glasswing {
namespace {

double gaussian(double a, double mu, double sigma, double k) {
  const double z = (k - mu) / sigma;
  return a * std::exp(-0.5 * z * z);
}

// Responses of `count` samples each, and a window around the middle of each.
struct Lines {
  std::vector<float> samples;
  std::vector<LineWindow> windows;
  std::vector<std::vector<LineGaussian>> truth;
};

Lines lines_of(std::vector<std::vector<LineGaussian>> truth, int half, double noise_sd, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  Lines lines{.samples = {}, .windows = {}, .truth = std::move(truth)};
  const int count = 2 * half + 1;
  for (const auto& modes : lines.truth) {
    for (int k = -half; k <= half; ++k) {
      double y = noise_sd * noise(random);
      for (const LineGaussian& mode : modes)
        y += gaussian(static_cast<double>(mode.amplitude), static_cast<double>(mode.centre),
                      static_cast<double>(mode.sigma), k);
      lines.samples.push_back(static_cast<float>(y));
    }
  }
  for (size_t i = 0; i < lines.truth.size(); ++i) {
    lines.windows.push_back(
        {.middle = lines.samples.data() + static_cast<int>(i) * count + half, .stride = 1, .half = half});
  }
  return lines;
}

struct Residual {
  double k, y;
  int modes;
  template <typename T>
  bool operator()(T const* const* p, T* residual) const {
    residual[0] = T(-y);
    for (int m = 0; m < modes; ++m) {
      const T z = (T(k) - p[0][3 * m + 1]) / p[0][3 * m + 2];
      residual[0] += p[0][3 * m] * exp(T(-0.5) * z * z);
    }
    return true;
  }
};

std::vector<double> ceres_fit(const LineWindow& window, std::vector<double> p) {
  ceres::Problem problem;
  for (int k = -window.half; k <= window.half; ++k) {
    auto* cost = new ceres::DynamicAutoDiffCostFunction<Residual, 6>(new Residual{
        static_cast<double>(k), static_cast<double>(window.middle[k]), static_cast<int>(p.size()) / 3});
    cost->AddParameterBlock(static_cast<int>(p.size()));
    cost->SetNumResiduals(1);
    problem.AddResidualBlock(cost, nullptr, p.data());
  }
  ceres::Solver::Options options;
  options.function_tolerance = options.parameter_tolerance = options.gradient_tolerance = 1e-14;
  options.max_num_iterations = 200;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return p;
}

std::vector<std::vector<LineGaussian>> singles(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> amplitude(0.2f, 1.0f), centre(-0.5f, 0.5f), sigma(2.05f, 5.0f);
  std::vector<std::vector<LineGaussian>> truth;
  for (int i = 0; i < count; ++i) truth.push_back({{amplitude(random), centre(random), sigma(random)}});
  return truth;
}

TEST(FitSingle, IsThatOfCeres) {
  const Lines lines = lines_of(singles(100, 1), 20, 0.005, 2);
  std::vector<SingleFit> fits(lines.windows.size());
  for (SingleFit& fit : fits) fit.peak = {0.7f, 0.0f, 3.0f};
  fit_single(lines.windows, fits);
  for (size_t i = 0; i < fits.size(); ++i) {
    ASSERT_TRUE(fits[i].settled) << i;
    const std::vector<double> reference = ceres_fit(lines.windows[i], {0.7, 0.0, 3.0});
    // Settled means that the last step was below 1e-3 sigma; convergence is at worst linear at the ratio of
    // noise to amplitude, so the remaining error is far smaller.
    EXPECT_NEAR(static_cast<double>(fits[i].peak.amplitude), reference[0], 2e-4);
    EXPECT_NEAR(static_cast<double>(fits[i].peak.centre), reference[1], 1e-3);
    EXPECT_NEAR(static_cast<double>(fits[i].peak.sigma), reference[2], 1e-3);
  }
}

// The bound for a Gaussian on a unit grid: sd(mu) = noise/a sqrt(2 sigma / sqrt(pi)), and the same for sigma
// although sigma and a share information.
TEST(FitSingle, ScattersAsLittleAsNoiseAllows) {
  constexpr int kTrials = 20000;
  constexpr double kNoise = 0.005, kSigma = 2.4;
  const std::vector<std::vector<LineGaussian>> truth(kTrials, {{0.8f, 0.3f, static_cast<float>(kSigma)}});
  const Lines lines = lines_of(truth, 12, kNoise, 3);
  std::vector<SingleFit> fits(kTrials);
  for (SingleFit& fit : fits) fit.peak = {0.7f, 0.0f, 2.0f};
  fit_single(lines.windows, fits);
  double centre = 0.0, width = 0.0;
  for (const SingleFit& fit : fits) {
    centre += std::pow(static_cast<double>(fit.peak.centre) - 0.3, 2);
    width += std::pow(static_cast<double>(fit.peak.sigma) - kSigma, 2);
  }
  const double bound = kNoise / 0.8 * std::sqrt(2.0 * kSigma / std::sqrt(std::numbers::pi));
  // A ratio of rms from N trials scatters by 1 / sqrt(2 N) = 0.5 %: four of these.
  EXPECT_NEAR(std::sqrt(centre / kTrials) / bound, 1.0, 0.02);
  EXPECT_NEAR(std::sqrt(width / kTrials) / bound, 1.0, 0.02);
}

TEST(FitDouble, IsThatOfCeres) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> amplitude(0.3f, 1.0f), apart(1.5f, 3.0f), sigma(2.05f, 3.5f);
  std::vector<std::vector<LineGaussian>> truth;
  for (int i = 0; i < 60; ++i) {
    const float half = apart(random) * 1.3f;
    truth.push_back({{amplitude(random), -half, sigma(random)}, {amplitude(random), half, sigma(random)}});
  }
  const Lines lines = lines_of(truth, 20, 0.003, 5);
  std::vector<DoubleFit> fits(lines.windows.size());
  for (DoubleFit& fit : fits) fit.peaks[0] = {0.6f, -2.5f, 2.5f}, fit.peaks[1] = {0.6f, 2.5f, 2.5f};
  fit_double(lines.windows, fits);
  int same = 0;
  for (size_t i = 0; i < fits.size(); ++i) {
    const std::vector<double> p = ceres_fit(lines.windows[i], {0.6, -2.5, 2.5, 0.6, 2.5, 2.5});
    double chi2 = 0.0;
    for (int k = -20; k <= 20; ++k) {
      chi2 += std::pow(gaussian(p[0], p[1], p[2], k) + gaussian(p[3], p[4], p[5], k) -
                           static_cast<double>(lines.windows[i].middle[k]),
                       2);
    }
    same += fits[i].settled && static_cast<double>(fits[i].chi2) <= chi2 * (1.0 + 1e-3) ? 1 : 0;
  }
  EXPECT_GE(same, 59);
}

TEST(Fits, SurviveWhatIsNoGaussian) {
  std::vector<std::vector<float>> shapes;
  shapes.push_back(std::vector<float>(41, 0.0f));
  shapes.push_back(std::vector<float>(41, 0.5f));
  shapes.push_back(std::vector<float>(41, 0.0f));
  shapes.back()[20] = 1.0f;
  shapes.push_back(std::vector<float>(41, 0.0f));
  for (size_t i = 15; i < 41; ++i) shapes.back()[i] = 1.0f;
  shapes.push_back(std::vector<float>(41, -1.0f));
  std::vector<LineWindow> windows;
  for (const auto& shape : shapes) windows.push_back({.middle = shape.data() + 20, .stride = 1, .half = 20});
  std::vector<SingleFit> one(windows.size());
  std::vector<DoubleFit> two(windows.size());
  for (SingleFit& fit : one) fit.peak = {0.5f, 0.0f, 2.0f};
  for (DoubleFit& fit : two) fit.peaks[0] = {0.5f, -2.0f, 2.0f}, fit.peaks[1] = {0.5f, 2.0f, 2.0f};
  fit_single(windows, one);
  fit_double(windows, two);
  for (size_t i = 0; i < windows.size(); ++i) {
    EXPECT_TRUE(std::isfinite(one[i].peak.amplitude + one[i].peak.centre + one[i].peak.sigma)) << i;
    for (const LineGaussian& peak : two[i].peaks) {
      EXPECT_TRUE(std::isfinite(peak.amplitude + peak.centre + peak.sigma)) << i;
    }
  }
}

struct Block {
  std::vector<float> y;
  SweepBlock sweep;
};

// The same truth in every lane, with independent noise.
Block block_of(const std::vector<LineGaussian>& modes, int count, double noise_sd, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  Block block;
  for (int i = 0; i < count; ++i) {
    for (int lane = 0; lane < kBlockLanes; ++lane) {
      double y = noise_sd * noise(random);
      for (const LineGaussian& mode : modes)
        y += gaussian(static_cast<double>(mode.amplitude), static_cast<double>(mode.centre),
                      static_cast<double>(mode.sigma), i);
      block.y.push_back(static_cast<float>(y));
    }
  }
  block.sweep = {.y = block.y.data(), .count = count, .first_r_px = -10.0, .step_px = 2.0};
  return block;
}

TEST(Peaks, NoiseIsFoundUnderPeaks) {
  const Block block = block_of({{0.9f, 60.0f, 2.5f}, {0.4f, 130.0f, 4.0f}}, 300, 0.01, 6);
  double mean = 0.0;
  for (const float sd : estimate_noise(block.sweep)) mean += static_cast<double>(sd) / kBlockLanes;
  // 16 lanes of 300 second differences, correlated over three: 1.2 % standard error.
  EXPECT_NEAR(mean, 0.01, 0.0006);
}

std::array<Peaks, kBlockLanes> peaks_of(const Block& block, float noise_sd) {
  std::array<float, kBlockLanes> floor, noise;
  floor.fill(4.0f * noise_sd);
  noise.fill(noise_sd);
  std::vector<std::array<Peaks, kBlockLanes>> found;
  PeakFinder().find({&block.sweep, 1}, floor, noise, 0xffffu, found);
  return found.front();
}

TEST(Peaks, ComeBackWithPlaceAndWidth) {
  const Block block =
      block_of({{0.9f, 60.3f, 2.5f}, {0.4f, 100.0f, 6.0f}, {0.2f, 1.0f, 2.2f}}, 150, 0.002, 7);
  for (const Peaks& peaks : peaks_of(block, 0.002f)) {
    ASSERT_EQ(peaks.count, 3);
    // Five standard errors: noise / a sqrt(2 sigma / sqrt(pi)) steps of 2 px.
    EXPECT_NEAR(peaks.peaks[0].centre_px, -10.0 + 2.0 * 60.3, 5.0 * 2.0 * 0.0037);
    EXPECT_NEAR(peaks.peaks[0].sigma_px, 5.0, 5.0 * 2.0 * 0.0037);
    EXPECT_NEAR(peaks.peaks[1].centre_px, 190.0, 5.0 * 2.0 * 0.013);
    // Cut off by the sweep's end: its position is known to a step.
    EXPECT_NEAR(peaks.peaks[2].centre_px, -8.0, 2.0);
  }
}

TEST(Peaks, TwoUnderOneHumpAreTwo) {
  // 2 sigma apart there is no dip between equal peaks.
  const Block block = block_of({{0.6f, 60.0f, 2.5f}, {0.6f, 65.0f, 2.5f}}, 150, 0.005, 8);
  int both = 0;
  for (const Peaks& peaks : peaks_of(block, 0.005f)) both += peaks.count == 2 ? 1 : 0;
  EXPECT_GE(both, 15);
}

TEST(Peaks, OneIsNotTakenForTwo) {
  int more = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    const Block block = block_of({{0.7f, 60.4f, 2.8f}}, 150, 0.01, 100 + seed);
    for (const Peaks& peaks : peaks_of(block, 0.01f)) more += peaks.count > 1 ? 1 : 0;
  }
  // 640 responses; 4 sd noise peaks among 150 samples add 0.5 %.
  EXPECT_LE(more, 13);
}

}  // namespace
}  // namespace glasswing
