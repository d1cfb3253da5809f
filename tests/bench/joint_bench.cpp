// Compares the joint fit of one pixel's four sweeps with peers on the same samples from the same start.
#include <cmath>
#include <random>

#include "tests/bench/peers.h"
#include "tests/solver/gaussian/simulated_pixel.h"

namespace glasswing {
namespace {

constexpr int kPixels = 256;
constexpr double kNoise = 0.005;

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
      truths.push_back(truth);
      samples.push_back(recorded(truth, layout, kNoise, random));
      for (Footprint& mode : truth) {
        mode.weight *= 0.95, mode.x_px += shift(random), mode.y_px += shift(random);
        mode.xx_px2 *= 1.1, mode.yy_px2 *= 0.9;
      }
      starts.push_back(truth);
    }
  }
  SampleLayout layout;
  std::vector<PixelSamples> samples;
  std::vector<Footprints> truths, starts;
};

void batch_ours(benchmark::State& state, int modes) {
  const Pixels pixels(modes);
  std::vector<BatchPixel> batch;
  for (size_t i = 0; i < kPixels; ++i) batch.push_back(batch_pixel(pixels.samples[i], pixels.starts[i]));
  std::vector<BatchFit> fits(kPixels);
  for (auto _ : state) {
    fit_batch({.layout = pixels.layout}, batch, fits);
    benchmark::DoNotOptimize(fits.data());
  }
  state.SetItemsProcessed(state.iterations() * kPixels);
}

void general_ours(benchmark::State& state, int modes) {
  const Pixels pixels(modes);
  JointWorkspace workspace;
  std::int64_t fits = 0;
  for (auto _ : state) {
    const size_t i = fits++ % kPixels;
    benchmark::DoNotOptimize(
        fit_jointly(pixels.samples[i], pixels.starts[i], kSimulatedExtent, {.max_steps = 50}, workspace));
  }
  state.SetItemsProcessed(fits);
}

// The samples that fit_batch uses, within 5 sigma_r of a mode's start; Sigma by its Cholesky factor, as
// there.
template <int kModes>
class JointModel {
 public:
  static constexpr int kParameters = 6 * kModes;

  JointModel(const PixelSamples& samples, const Footprints& start) {
    for (const SampleLayout::Sweep& sweep : samples.layout->sweeps) {
      for (int i = 0; i < sweep.count; ++i) {
        const size_t place = sweep.first + i;
        const double r = sweep.first_r_px + static_cast<double>(samples.layout->offset_px[place]);
        const bool near = std::any_of(start.begin(), start.end(), [&](const Footprint& mode) {
          const double centre = mode.x_px * sweep.axis.cos_phi + mode.y_px * sweep.axis.sin_phi;
          return std::abs(r - centre) < 5.0 * std::sqrt(answered_variance(mode, sweep.axis));
        });
        if (near) r_px_.push_back(r), y_.push_back(static_cast<double>(samples.y[place]));
      }
      sweeps_.push_back({sweep.axis, r_px_.size()});
    }
  }

  int residual_count() const { return static_cast<int>(y_.size()); }

  void evaluate(const double* p, double* residuals, double* jacobian, std::ptrdiff_t row,
                std::ptrdiff_t column) const {
    for (size_t i = 0; i < y_.size(); ++i) residuals[i] = -y_[i];
    size_t first = 0;
    for (const auto& [axis, end] : sweeps_) {
      const double c = axis.cos_phi, s = axis.sin_phi;
      for (int m = 0; m < kModes; ++m) {
        const double* q = p + 6 * m;
        const double a = c * q[3] + s * q[4], b = s * q[5], centre = c * q[1] + s * q[2];
        const double variance = a * a + b * b + axis.sigma_px * axis.sigma_px + kFlatPixel_px2;
        const double inverse_sigma = 1.0 / std::sqrt(variance), peak = axis.sigma_px * inverse_sigma;
        for (size_t i = first; i < end; ++i) {
          const double z = (r_px_[i] - centre) * inverse_sigma;
          const double unit = peak * std::exp(-0.5 * z * z), value = q[0] * unit;
          residuals[i] += value;
          if (jacobian == nullptr) continue;
          double* j = jacobian + static_cast<std::ptrdiff_t>(i) * row + 6 * m * column;
          const double by_centre = value * z * inverse_sigma, by_a = value * (z * z - 1.0) / variance;
          j[0] = unit, j[column] = by_centre * c, j[2 * column] = by_centre * s;
          j[3 * column] = by_a * a * c, j[4 * column] = by_a * a * s, j[5 * column] = by_a * b * s;
        }
      }
      first = end;
    }
  }

  static Parameters<JointModel> factored(const Footprints& modes) {
    Parameters<JointModel> p;
    for (int m = 0; m < kModes; ++m) {
      const Footprint& mode = modes[m];
      const double l11 = std::sqrt(mode.xx_px2), l21 = mode.xy_px2 / l11;
      const double l22 = std::sqrt(std::max(mode.yy_px2 - l21 * l21, 1e-3));
      p.template segment<6>(6 * m) << mode.weight, mode.x_px, mode.y_px, l11, l21, l22;
    }
    return p;
  }

 private:
  struct Sweep {
    StripeAxis axis;
    size_t end;  // of its samples
  };
  std::vector<Sweep> sweeps_;
  std::vector<double> r_px_, y_;
};

// The pixels of one number of modes, and every solver's answers to them as (R, x, y, xx, xy, yy) of each
// mode.
template <int kModes>
class JointPeers {
 public:
  using Model = JointModel<kModes>;
  using Answer = Parameters<Model>;
  // The rule of fit_batch: the next step would be shorter than a tenth of its standard error.
  static constexpr StoppingRule kRule{.chi2_gain = 0.01, .step = 0.0, .noise_sd = kNoise};

  static const JointPeers& get() {
    static const JointPeers all;
    return all;
  }

  Pixels pixels{kModes};
  std::vector<Model> models;
  std::vector<Answer> starts;
  Comparison ceres, tiny, general;  // batch with Ceres and TinySolver, one after another with Ceres

 private:
  JointPeers() {
    JointWorkspace workspace;
    std::vector<BatchPixel> batch;
    std::vector<BatchFit> fits(kPixels);
    std::vector<Answer> sd;
    std::vector<std::optional<Answer>> together, single;
    for (size_t i = 0; i < kPixels; ++i) {
      models.emplace_back(pixels.samples[i], pixels.starts[i]);
      starts.push_back(Model::factored(pixels.starts[i]));
      sd.push_back(kNoise * Answer(cramer_rao_bound(pixels.truths[i], pixels.layout).data()));
      batch.push_back(batch_pixel(pixels.samples[i], pixels.starts[i]));
      single.push_back(stored(
          fit_jointly(pixels.samples[i], pixels.starts[i], kSimulatedExtent, {.max_steps = 50}, workspace)));
    }
    fit_batch({.layout = pixels.layout}, batch, fits);
    for (const BatchFit& fit : fits) together.push_back(stored(fit.sweeps));
    const auto by_ceres = stored(answers(CeresPeer<Model>(kRule), models, starts));
    ceres = compared(together, by_ceres, sd);
    general = compared(single, by_ceres, sd);
    tiny = compared(together, stored(answers(TinyPeer<Model>(kRule), models, starts)), sd);
  }

  static std::optional<Answer> stored(JointFit fit) {
    if (!fit.converged) return std::nullopt;
    Answer answer;
    for (int p = 0; p < Model::kParameters; ++p) answer[p] = parameter(fit.modes[p / 6], p % 6);
    return answer;
  }
  static std::vector<std::optional<Answer>> stored(std::vector<std::optional<Answer>> factored) {
    for (std::optional<Answer>& p : factored) {
      for (int m = 0; p && m < kModes; ++m) {
        const double l11 = (*p)[6 * m + 3], l21 = (*p)[6 * m + 4], l22 = (*p)[6 * m + 5];
        p->template segment<3>(6 * m + 3) << l11 * l11, l11 * l21, l21 * l21 + l22 * l22;
      }
    }
    return factored;
  }
};

template <int kModes>
void joint_ceres(benchmark::State& state) {
  const auto& all = JointPeers<kModes>::get();
  run_peer(state, CeresPeer<JointModel<kModes>>(all.kRule), all.models, all.starts, all.ceres);
}

template <int kModes>
void joint_tiny(benchmark::State& state) {
  const auto& all = JointPeers<kModes>::get();
  run_peer(state, TinyPeer<JointModel<kModes>>(all.kRule), all.models, all.starts, all.tiny);
}

template <int kModes>
void add_rows(std::vector<Row>& rows, const std::string& figure) {
  const auto named = [](const char* name) { return fmt::format("{}_{}", name, kModes); };
  benchmark::RegisterBenchmark(named("batch_ours").c_str(), batch_ours, kModes);
  benchmark::RegisterBenchmark(named("joint_ceres").c_str(), joint_ceres<kModes>);
  benchmark::RegisterBenchmark(named("joint_tiny").c_str(), joint_tiny<kModes>);
  using Peers = JointPeers<kModes>;
  add_peer_rows(rows, figure, "Ceres", named("batch_ours"), named("joint_ceres"),
                []() -> const Comparison& { return Peers::get().ceres; });
  rows.push_back({figure + ": pixels/s at Ceres' answers, one core",
                  "thousand/s",
                  {named("batch_ours")},
                  [named](const Rates& rates) {
                    return 1e-3 * rates.at(named("batch_ours")) * Peers::get().ceres.equal_share();
                  }});
  add_peer_rows(rows, figure, "TinySolver", named("batch_ours"), named("joint_tiny"),
                []() -> const Comparison& { return Peers::get().tiny; });
}

}  // namespace

void add_joint_rows(std::vector<Row>& rows) {
  add_rows<1>(rows, "joint fit of four sweeps, one mode");
  add_rows<2>(rows, "joint fit of four sweeps, two modes");
  benchmark::RegisterBenchmark("general_ours_2", general_ours, 2);
  rows.push_back({"the same, one pixel after another with the monitor's edges",
                  "x",
                  {"general_ours_2", "joint_ceres_2"},
                  [](const Rates& rates) {
                    return rates.at("general_ours_2") * JointPeers<2>::get().general.equal_share() /
                           rates.at("joint_ceres_2");
                  }});
}

}  // namespace glasswing
