// Compares the joint fit of one pixel's four sweeps with Ceres on the same windows from the same start.
#include <benchmark/benchmark.h>
#include <ceres/ceres.h>

#include <cmath>
#include <random>

#include "tests/bench/rows.h"
#include "tests/solver/gaussian/simulated_pixel.h"

namespace glasswing {
namespace {

constexpr int kPixels = 256;

struct Pixels {
  explicit Pixels(int modes) : layout(four_sweeps(4.0)) {
    std::mt19937 random(31);
    std::uniform_real_distribution<double> x(30.0, 98.0), y(30.0, 66.0), variance(1.0, 9.0), turn(-0.8, 0.8),
        weight(0.3, 0.9), shift(-0.2, 0.2);
    for (int i = 0; i < kPixels; ++i) {
      Footprints truth;
      for (int m = 0; m < modes; ++m) {
        Footprint mode{.weight = weight(random),
                       .x_px = x(random),
                       .y_px = y(random),
                       .xx_px2 = variance(random),
                       .xy_px2 = 0.0,
                       .yy_px2 = variance(random)};
        mode.xy_px2 = turn(random) * std::sqrt(mode.xx_px2 * mode.yy_px2);
        truth.push_back(mode);
      }
      samples.push_back(recorded(truth, layout, 0.005, random));
      for (Footprint& mode : truth) {
        mode.weight *= 0.95, mode.x_px += shift(random), mode.y_px += shift(random);
        mode.xx_px2 *= 1.1, mode.yy_px2 *= 0.9;
      }
      starts.push_back(truth);
    }
  }
  SampleLayout layout;
  std::vector<PixelSamples> samples;
  std::vector<Footprints> starts;
};

void batch_ours(benchmark::State& state, int modes) {
  const Pixels pixels(modes);
  std::vector<BatchPixel> batch;
  for (size_t i = 0; i < kPixels; ++i) batch.push_back(batch_pixel(pixels.samples[i], pixels.starts[i]));
  std::vector<JointFit> fits(kPixels);
  for (auto _ : state) {
    fit_batch(pixels.layout, 1, batch, fits);
    benchmark::DoNotOptimize(fits.data());
  }
  state.SetItemsProcessed(state.iterations() * kPixels);
}

void general_ours(benchmark::State& state, int modes) {
  const Pixels pixels(modes);
  JointWorkspace workspace;
  std::int64_t fits = 0;
  for (auto _ : state) {
    const auto i = static_cast<size_t>(fits++ % kPixels);
    benchmark::DoNotOptimize(
        fit_jointly(pixels.samples[i], pixels.starts[i], kSimulatedExtent, 50, workspace));
  }
  state.SetItemsProcessed(fits);
}

// Samples within 4.7 sigma_r of a mode's start; Sigma by its Cholesky factor.
class JointCost final : public ceres::CostFunction {
 public:
  JointCost(const PixelSamples& samples, const Footprints& start) : modes_(start.size()) {
    for (const SampleLayout::Sweep& sweep : samples.layout->sweeps) {
      for (int i = 0; i < sweep.count; ++i) {
        const auto place = static_cast<size_t>(sweep.first + i);
        const double r = sweep.first_r_px + static_cast<double>(samples.layout->offset_px[place]);
        bool near = false;
        for (const Footprint& mode : start) {
          const double centre = mode.x_px * sweep.axis.cos_phi + mode.y_px * sweep.axis.sin_phi;
          near = near || std::abs(r - centre) < 4.7 * std::sqrt(answered_variance(mode, sweep.axis));
        }
        if (near) samples_.push_back({sweep.axis, r, static_cast<double>(samples.y[place])});
      }
    }
    set_num_residuals(static_cast<int>(samples_.size()));
    mutable_parameter_block_sizes()->push_back(6 * modes_);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    for (size_t i = 0; i < samples_.size(); ++i) {
      const Sample& sample = samples_[i];
      const double c = sample.axis.cos_phi, s = sample.axis.sin_phi;
      residuals[i] = -sample.y;
      for (int m = 0; m < modes_; ++m) {
        const double* q = parameters[0] + 6 * m;
        const double a = c * q[3] + s * q[4], b = s * q[5];
        const double variance = a * a + b * b + sample.axis.sigma_px * sample.axis.sigma_px + kFlatPixel_px2;
        const double sigma = std::sqrt(variance), z = (sample.r - c * q[1] - s * q[2]) / sigma;
        const double unit = sample.axis.sigma_px / sigma * std::exp(-0.5 * z * z), value = q[0] * unit;
        residuals[i] += value;
        if (jacobians == nullptr || jacobians[0] == nullptr) continue;
        double* j = jacobians[0] + static_cast<int>(i) * 6 * modes_ + 6 * m;
        const double by_centre = value * z / sigma, by_variance = 0.5 * value * (z * z - 1.0) / variance;
        j[0] = unit, j[1] = by_centre * c, j[2] = by_centre * s;
        j[3] = by_variance * 2.0 * a * c, j[4] = by_variance * 2.0 * a * s, j[5] = by_variance * 2.0 * b * s;
      }
    }
    return true;
  }

 private:
  struct Sample {
    StripeAxis axis;
    double r, y;
  };
  int modes_;
  std::vector<Sample> samples_;
};

void joint_ceres(benchmark::State& state, int modes) {
  const Pixels pixels(modes);
  std::int64_t fits = 0;
  for (auto _ : state) {
    const auto i = static_cast<size_t>(fits++ % kPixels);
    std::vector<double> p;
    for (const Footprint& mode : pixels.starts[i]) {
      const double a = std::sqrt(mode.xx_px2), b = mode.xy_px2 / a;
      p.insert(p.end(),
               {mode.weight, mode.x_px, mode.y_px, a, b, std::sqrt(std::max(mode.yy_px2 - b * b, 1e-3))});
    }
    ceres::Problem problem;
    problem.AddResidualBlock(new JointCost(pixels.samples[i], pixels.starts[i]), nullptr, p.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    benchmark::DoNotOptimize(p.data());
  }
  state.SetItemsProcessed(fits);
}

}  // namespace

void add_joint_rows(std::vector<Row>& rows) {
  benchmark::RegisterBenchmark("batch_ours_1", batch_ours, 1);
  benchmark::RegisterBenchmark("batch_ours_2", batch_ours, 2);
  benchmark::RegisterBenchmark("general_ours_2", general_ours, 2);
  benchmark::RegisterBenchmark("joint_ceres_1", joint_ceres, 1);
  benchmark::RegisterBenchmark("joint_ceres_2", joint_ceres, 2);
  rows.push_back({"joint fit of four sweeps, one mode: fits/s over Ceres",
                  "x",
                  50.0,
                  false,
                  {"batch_ours_1", "joint_ceres_1"},
                  [](const Rates& rates) { return rates.at("batch_ours_1") / rates.at("joint_ceres_1"); }});
  rows.push_back({"joint fit of four sweeps, two modes: fits/s over Ceres",
                  "x",
                  25.0,
                  false,
                  {"batch_ours_2", "joint_ceres_2"},
                  [](const Rates& rates) { return rates.at("batch_ours_2") / rates.at("joint_ceres_2"); }});
  rows.push_back({"the same, one pixel after another with the monitor's edges",
                  "x",
                  3.0,
                  false,
                  {"general_ours_2", "joint_ceres_2"},
                  [](const Rates& rates) { return rates.at("general_ours_2") / rates.at("joint_ceres_2"); }});
}

}  // namespace glasswing
