// Compares one-dimensional fits with peers on the same windows, and measures the whole stage from frames to
// peaks.
#include <cmath>
#include <random>

#include "solver/gaussian/peaks.h"
#include "solver/gaussian/sample_tile.h"
#include "solver/method/sample_noise.h"
#include "tests/bench/peers.h"

namespace glasswing {
namespace {

constexpr int kSamples = 300, kResponses = 1024;
constexpr double kNoise = 0.002;

// Responses as the solver stores them: kBlockLanes side by side. Two samples are one sigma of the stripe;
// footprints widen the response by up to a half; noise, and 12 bits.
struct Responses {
  explicit Responses(int modes) {
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0.0, kNoise);
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
        double y = noise(random);
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

// Parameters are in units of the start's amplitude and sigma, with its centre as the origin.
template <int kModes>
class LineModel {
 public:
  static constexpr int kParameters = 3 * kModes;

  LineModel(const LineWindow& window, const DoubleFit& start) : window_(window), start_(start) {}

  int residual_count() const { return 2 * window_.half + 1; }

  void evaluate(const double* p, double* residuals, double* jacobian, std::ptrdiff_t row,
                std::ptrdiff_t column) const {
    for (int k = -window_.half; k <= window_.half; ++k)
      residuals[k + window_.half] = -static_cast<double>(window_.middle[k * window_.stride]);
    for (int m = 0; m < kModes; ++m) {
      const double unit = start_.peaks[m].amplitude;
      const double width = start_.peaks[m].sigma;
      const double amplitude = p[3 * m] * unit, inverse_sigma = 1.0 / (p[3 * m + 2] * width);
      const double centre = static_cast<double>(start_.peaks[m].centre) + p[3 * m + 1] * width;
      for (int k = -window_.half, i = 0; k <= window_.half; ++k, ++i) {
        const double z = (k - centre) * inverse_sigma, g = std::exp(-0.5 * z * z);
        residuals[i] += amplitude * g;
        if (jacobian == nullptr) continue;
        double* j = jacobian + i * row + 3 * m * column;
        const double by_centre = amplitude * g * z * inverse_sigma * width;
        j[0] = unit * g, j[column] = by_centre, j[2 * column] = by_centre * z;
      }
    }
  }

  static Parameters<LineModel> start() {
    Parameters<LineModel> p;
    for (int m = 0; m < kModes; ++m) p.template segment<3>(3 * m) << 1.0, 0.0, 1.0;
    return p;
  }

  Parameters<LineModel> parameters(const LineGaussian* peaks) const {
    Parameters<LineModel> p;
    for (int m = 0; m < kModes; ++m) {
      const LineGaussian &peak = peaks[m], &from = start_.peaks[m];
      p.template segment<3>(3 * m) << static_cast<double>(peak.amplitude / from.amplitude),
          static_cast<double>((peak.centre - from.centre) / from.sigma),
          static_cast<double>(peak.sigma / from.sigma);
    }
    return p;
  }

 private:
  LineWindow window_;
  DoubleFit start_;
};

// The responses of one number of modes, and the solvers' answers to them.
template <int kModes>
class LinePeers {
 public:
  using Model = LineModel<kModes>;
  using Answer = Parameters<Model>;

  static const LinePeers& get() {
    static const LinePeers all;
    return all;
  }

  Responses responses{kModes};
  std::vector<Model> models;
  std::vector<Answer> starts;
  StoppingRule rule;
  Comparison ceres, tiny;

 private:
  LinePeers() {
    std::vector<std::optional<Answer>> ours;
    const auto add = [&](bool settled, size_t i, const LineGaussian* peaks) {
      ours.push_back(settled ? std::optional(models[i].parameters(peaks)) : std::nullopt);
    };
    for (size_t i = 0; i < kResponses; ++i) models.emplace_back(responses.windows[i], responses.starts[i]);
    starts.assign(kResponses, Model::start());
    if constexpr (kModes == 1) {
      std::vector<SingleFit> fits;
      for (const DoubleFit& start : responses.starts) fits.push_back({.peak = start.peaks[0]});
      fit_single(responses.windows, fits);
      for (size_t i = 0; i < fits.size(); ++i) add(fits[i].settled, i, &fits[i].peak);
    } else {
      std::vector<DoubleFit> fits = responses.starts;
      fit_double(responses.windows, fits);
      for (size_t i = 0; i < fits.size(); ++i) add(fits[i].settled, i, fits[i].peaks);
    }
    std::vector<Answer> sd;
    for (size_t i = 0; i < kResponses; ++i)
      sd.push_back(standard_errors(models[i], ours[i].value_or(starts[i]), kNoise));
    // Our fits stop with a step below a thousandth of sigma and amplitude, and take it. The peers do not take
    // theirs, so it must be below a tenth of the standard errors for equal answers; the norm of parameters is
    // about that of 2 kModes ones.
    rule.step = 1.0;
    for (const Answer& errors : sd) rule.step = std::min(rule.step, 0.1 * errors.minCoeff());
    rule.step /= std::sqrt(2.0 * kModes);
    ceres = compared(ours, answers(CeresPeer<Model>(rule), models, starts), sd);
    tiny = compared(ours, answers(TinyPeer<Model>(rule), models, starts), sd);
  }
};

template <int kModes>
void line_ceres(benchmark::State& state) {
  const auto& all = LinePeers<kModes>::get();
  run_peer(state, CeresPeer<LineModel<kModes>>(all.rule), all.models, all.starts, all.ceres);
}

template <int kModes>
void line_tiny(benchmark::State& state) {
  const auto& all = LinePeers<kModes>::get();
  run_peer(state, TinyPeer<LineModel<kModes>>(all.rule), all.models, all.starts, all.tiny);
}

// 65536 responses of one sweep, as frames in memory; nine in ten have one peak, the others two.
struct Frames {
  static constexpr int kWidth = 65536 / 3 / 16 * 16, kLanes = 3 * kWidth;
  Frames() {
    stack.width_px = kWidth;
    stack.row_count = 1;
    std::mt19937 random(2);
    std::normal_distribution<double> noise(0.0, kNoise), step(0.0, 0.4), dispersion(0.0, 0.1);
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
      auto& frame = frames[k];
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
  const SampleNoise noise{.read_sd = kNoise, .gain = 0.0};
  SampleTile tile(frames.layout);
  PeakFinder finder;
  std::vector<std::array<Peaks, kBlockLanes>> found;
  std::array<float, kBlockLanes> floor, sd;
  floor.fill(0.008f);
  sd.fill(static_cast<float>(kNoise));
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

template <int kModes>
void add_rows(std::vector<Row>& rows, const std::string& figure, void (*ours)(benchmark::State&)) {
  const auto named = [](const char* name) { return fmt::format("{}_{}", name, kModes); };
  benchmark::RegisterBenchmark(named("line_ours").c_str(), ours);
  benchmark::RegisterBenchmark(named("line_ceres").c_str(), line_ceres<kModes>);
  benchmark::RegisterBenchmark(named("line_tiny").c_str(), line_tiny<kModes>);
  add_peer_rows(rows, figure, "Ceres", named("line_ours"), named("line_ceres"),
                []() -> const Comparison& { return LinePeers<kModes>::get().ceres; });
  add_peer_rows(rows, figure, "TinySolver", named("line_ours"), named("line_tiny"),
                []() -> const Comparison& { return LinePeers<kModes>::get().tiny; });
}

// Millions of items a second of one benchmark.
Row rate_row(const char* name, const std::string& benchmark) {
  return {
      name, "million/s", {benchmark}, [benchmark](const Rates& rates) { return rates.at(benchmark) * 1e-6; }};
}

}  // namespace

void add_line_rows(std::vector<Row>& rows) {
  add_rows<1>(rows, "one Gaussian, 1-D", single_ours);
  rows.push_back(rate_row("one Gaussian, 1-D: fits/s, one core", "line_ours_1"));
  add_rows<2>(rows, "two Gaussians, 1-D", double_ours);
  benchmark::RegisterBenchmark("stage", stage);
  rows.push_back(rate_row("whole 1-D stage: responses/s, one core, from memory", "stage"));
}

}  // namespace glasswing
