// Compares one-dimensional fits with Ceres on the same windows, and measures the whole stage from frames to
// peaks.
#include <benchmark/benchmark.h>
#include <ceres/ceres.h>

#include <cmath>
#include <random>

#include "solver/gaussian/peaks.h"
#include "solver/gaussian/sample_tile.h"
#include "solver/method/sample_noise.h"
#include "tests/bench/rows.h"

namespace glasswing {
namespace {

constexpr int kSamples = 300, kResponses = 1024;

// Responses as the solver stores them: kBlockLanes side by side. Two samples are one sigma of the stripe;
// footprints widen the response by up to a half; 12 bits.
struct Responses {
  explicit Responses(int modes) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> place(30.0, 270.0), widening(1.0, 1.5), amplitude(0.3, 0.9),
        apart(2.0, 4.0), shift(-0.3, 0.3);
    samples.resize(static_cast<size_t>(kSamples) * kResponses);
    for (int i = 0; i < kResponses; ++i) {
      double p[6];
      const double centre = place(random);
      const double gap = modes == 2 ? apart(random) * 2.0 : 0.0;
      for (int m = 0; m < modes; ++m) {
        p[3 * m] = amplitude(random);
        p[3 * m + 1] = centre + (m - 0.5 * (modes - 1)) * gap;
        p[3 * m + 2] = 2.0 * widening(random);
      }
      float* first =
          samples.data() + static_cast<size_t>(i / kBlockLanes) * kSamples * kBlockLanes + i % kBlockLanes;
      for (int k = 0; k < kSamples; ++k) {
        double y = 0.0;
        for (int m = 0; m < modes; ++m)
          y += p[3 * m] * std::exp(-0.5 * std::pow((k - p[3 * m + 1]) / p[3 * m + 2], 2));
        first[k * kBlockLanes] = static_cast<float>(std::round(y * 4095.0) / 4095.0);
      }
      const int middle = static_cast<int>(std::lround(centre));
      const double reach = 0.5 * gap + 4.0 * std::max(p[2], modes == 2 ? p[5] : 0.0);
      windows.push_back(
          {.middle = first + middle * kBlockLanes,
           .stride = kBlockLanes,
           .half = std::min({static_cast<int>(std::ceil(reach)), middle, kSamples - 1 - middle})});
      DoubleFit start;
      for (int m = 0; m < modes; ++m) {
        start.peaks[m] = {static_cast<float>(0.9 * p[3 * m]),
                          static_cast<float>(p[3 * m + 1] - middle + shift(random)),
                          static_cast<float>(1.15 * p[3 * m + 2])};
      }
      starts.push_back(start);
    }
    // In the peak finder's order.
    std::vector<size_t> order(windows.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::sort(order.begin(), order.end(),
              [&](size_t a, size_t b) { return windows[a].half < windows[b].half; });
    const std::vector<LineWindow> unsorted_windows = windows;
    const std::vector<DoubleFit> unsorted_starts = starts;
    for (size_t i = 0; i < order.size(); ++i)
      windows[i] = unsorted_windows[order[i]], starts[i] = unsorted_starts[order[i]];
  }
  std::vector<float> samples;
  std::vector<LineWindow> windows;
  std::vector<DoubleFit> starts;
};

void single_ours(benchmark::State& state) {
  const Responses responses(1);
  std::vector<SingleFit> start(responses.windows.size());
  for (size_t i = 0; i < start.size(); ++i) start[i].peak = responses.starts[i].peaks[0];
  std::vector<SingleFit> fits;
  for (auto _ : state) {
    fits = start;
    fit_single(responses.windows, fits);
    benchmark::DoNotOptimize(fits.data());
  }
  state.SetItemsProcessed(state.iterations() * kResponses);
}

void double_ours(benchmark::State& state) {
  const Responses responses(2);
  std::vector<DoubleFit> fits;
  for (auto _ : state) {
    fits = responses.starts;
    fit_double(responses.windows, fits);
    benchmark::DoNotOptimize(fits.data());
  }
  state.SetItemsProcessed(state.iterations() * kResponses);
}

class LineCost final : public ceres::CostFunction {
 public:
  LineCost(const LineWindow& window, int modes) : window_(window), modes_(modes) {
    set_num_residuals(2 * window.half + 1);
    mutable_parameter_block_sizes()->push_back(3 * modes);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double* p = parameters[0];
    for (int k = -window_.half, row = 0; k <= window_.half; ++k, ++row) {
      residuals[row] = -static_cast<double>(window_.middle[k * window_.stride]);
      for (int m = 0; m < modes_; ++m) {
        const double z = (k - p[3 * m + 1]) / p[3 * m + 2], g = std::exp(-0.5 * z * z);
        residuals[row] += p[3 * m] * g;
        if (jacobians == nullptr || jacobians[0] == nullptr) continue;
        double* j = jacobians[0] + row * 3 * modes_ + 3 * m;
        j[0] = g;
        j[1] = p[3 * m] * g * z / p[3 * m + 2];
        j[2] = p[3 * m] * g * z * z / p[3 * m + 2];
      }
    }
    return true;
  }

 private:
  const LineWindow& window_;
  int modes_;
};

void line_ceres(benchmark::State& state, int modes) {
  const Responses responses(modes);
  std::int64_t fits = 0;
  for (auto _ : state) {
    const auto i = static_cast<size_t>(fits++ % kResponses);
    double p[6];
    for (int m = 0; m < modes; ++m) {
      const LineGaussian& peak = responses.starts[i].peaks[m];
      p[3 * m] = static_cast<double>(peak.amplitude), p[3 * m + 1] = static_cast<double>(peak.centre);
      p[3 * m + 2] = static_cast<double>(peak.sigma);
    }
    ceres::Problem problem;
    problem.AddResidualBlock(new LineCost(responses.windows[i], modes), nullptr, p);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    benchmark::DoNotOptimize(p);
  }
  state.SetItemsProcessed(fits);
}

// 65536 responses of one sweep, as frames in memory; nine in ten have one peak, the others two.
struct Frames {
  static constexpr int kWidth = 65536 / 3 / 16 * 16, kLanes = 3 * kWidth;
  Frames() {
    stack.width_px = kWidth;
    stack.row_count = 1;
    std::mt19937 random(2);
    std::normal_distribution<double> noise(0.0, 0.002), step(0.0, 0.4), dispersion(0.0, 0.1);
    std::uniform_real_distribution<double> place(20.0, 280.0), widening(1.0, 1.5), amplitude(0.2, 0.9),
        share(0.0, 1.0);
    std::vector<std::array<double, 6>> modes(kLanes);
    // The peaks move slowly from pixel to pixel, as views do, and sometimes jump.
    std::array<double, 6> pixel{};
    for (size_t i = 0; i < kLanes; ++i) {
      if (i % 3 == 0) {
        if (i == 0 || share(random) < 0.01) {
          pixel = {amplitude(random), place(random),         2.0 * widening(random), 0.0,
                   place(random),     2.0 * widening(random)};
          if (share(random) < 0.1) pixel[3] = amplitude(random);
        }
        for (const size_t centre : {1u, 4u})
          pixel[centre] = std::clamp(pixel[centre] + step(random), 20.0, 280.0);
      }
      modes[i] = pixel;
      modes[i][1] += dispersion(random), modes[i][4] += dispersion(random);
    }
    frames.resize(kSamples);
    SweepLayout& sweep = layout.sweeps.emplace_back();
    sweep.sigma_px = 4.0;
    for (int k = 0; k < kSamples; ++k) {
      auto& frame = frames[static_cast<size_t>(k)];
      frame.reserve(kLanes);
      for (const auto& m : modes) {
        double y = 0.01 + noise(random);
        for (size_t i = 0; i < 6; i += 3) {
          const double z = (k - m[i + 1]) / m[i + 2];
          if (m[i] > 0.0 && std::abs(z) < 6.0) y += m[i] * std::exp(-0.5 * z * z);
        }
        frame.push_back(static_cast<std::uint16_t>(std::lround(std::clamp(y, 0.0, 0.99) * 4095.0) * 16));
      }
      stack.rows.push_back(frame);
      sweep.shots.push_back({{.frame = k, .scale = 1.0}});
      sweep.r_px.push_back(2.0 * k);
      sweep.peak.push_back({1.0, 1.0, 1.0});
    }
  }
  std::vector<std::vector<std::uint16_t>> frames;
  FrameStack stack;
  StackLayout layout;
};

void stage(benchmark::State& state) {
  static const Frames frames;
  const SampleNoise noise{.read_sd = 0.002, .gain = 0.0};
  SampleTile tile(frames.layout);
  PeakFinder finder;
  std::vector<std::array<Peaks, kBlockLanes>> found;
  std::array<float, kBlockLanes> floor, sd;
  floor.fill(0.008f);
  sd.fill(0.002f);
  for (auto _ : state) {
    for (int first = 0; first < Frames::kLanes; first += SampleTile::kMaxBlocks * kBlockLanes) {
      tile.load(frames.stack, 0, first,
                std::min(SampleTile::kMaxBlocks * kBlockLanes, Frames::kLanes - first), noise);
      for (int block = 0; block < tile.block_count(); ++block) {
        float* y = tile.samples(block, 0);
        for (int i = 0; i < kSamples * kBlockLanes; ++i) y[i] -= 0.01f;
        const SweepBlock sweep{.y = y, .count = kSamples, .first_r_px = 0.0, .step_px = 2.0};
        finder.find({&sweep, 1}, floor, sd, 0xffffu, found);
        benchmark::DoNotOptimize(found.data());
      }
    }
  }
  state.SetItemsProcessed(state.iterations() * Frames::kLanes);
}

}  // namespace

void add_line_rows(std::vector<Row>& rows) {
  benchmark::RegisterBenchmark("single_ours", single_ours);
  benchmark::RegisterBenchmark("double_ours", double_ours);
  benchmark::RegisterBenchmark("single_ceres", line_ceres, 1);
  benchmark::RegisterBenchmark("double_ceres", line_ceres, 2);
  benchmark::RegisterBenchmark("stage", stage);
  const auto ratio = [](const char* a, const char* b) {
    return [a, b](const Rates& rates) { return rates.at(a) / rates.at(b); };
  };
  const auto millions = [](const char* a) { return [a](const Rates& rates) { return rates.at(a) * 1e-6; }; };
  rows.push_back({"one Gaussian, 1-D: fits/s over Ceres",
                  "x",
                  250.0,
                  false,
                  {"single_ours", "single_ceres"},
                  ratio("single_ours", "single_ceres")});
  rows.push_back({"one Gaussian, 1-D: fits/s, one core",
                  "million/s",
                  16.0,
                  false,
                  {"single_ours"},
                  millions("single_ours")});
  rows.push_back({"two Gaussians, 1-D: fits/s over Ceres",
                  "x",
                  60.0,
                  false,
                  {"double_ours", "double_ceres"},
                  ratio("double_ours", "double_ceres")});
  rows.push_back({"whole 1-D stage: responses/s, one core, from memory",
                  "million/s",
                  5.0,
                  false,
                  {"stage"},
                  millions("stage")});
}

}  // namespace glasswing
