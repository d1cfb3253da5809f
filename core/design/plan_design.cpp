#include "core/design/plan_design.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <span>

#include "core/base/median.h"
#include "core/base/status.h"
#include "core/design/information.h"
#include "core/design/shape_waves.h"
#include "core/design/wave_ladder.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr int kDraws = 32;             // of the prior
constexpr double kLight = 0.9;         // of all footprints of a pixel
constexpr double kLeastWeight = 0.15;  // of one of several
constexpr double kMostRatio = 2.5;     // from one period of a ladder to the next
constexpr double kPeriodStep = 1.15;
constexpr double kMargin = 1.5;  // sigmas that stripes start before the monitor's edge
constexpr std::array<double, 4> kDirections_deg{0.0, 90.0, 45.0, -45.0};

// Bars of a monitor: an eighth of its longer side as a power of two, a sixteenth and a 32nd.
struct Bars {
  int first_level = 3, levels = 5;
  int images() const { return 2 * (levels - first_level + 1); }
};

double bar_px(const MonitorExtent& extent, int level) {
  return std::exp2(std::ceil(std::log2(std::max(extent.width_px, extent.height_px))) - level);
}

std::vector<ShownPattern> stage_of(const MonitorExtent& extent, const Bars& bars) {
  std::vector<ShownPattern> patterns(1);  // white
  for (const bool horizontal : {false, true}) {
    for (int level = bars.first_level; level <= bars.levels; ++level) {
      ShownPattern pattern;
      pattern.lit = {.bars = true, .horizontal = horizontal, .bar_px = bar_px(extent, level)};
      patterns.push_back(pattern);
    }
  }
  return patterns;
}

double ratio_of(const std::vector<DesignedWave>& waves) {
  double most = 1.0;
  for (size_t i = 1; i < waves.size(); ++i) {
    if (waves[i].phi_deg == waves[i - 1].phi_deg)
      most = std::max(most, waves[i - 1].period_px / waves[i].period_px);
  }
  return most;
}

struct Candidate {
  v1::Plan plan;
  std::string words;
  ExpectedErrors expected;
};

void add_stage(const Bars& bars, v1::Plan& plan) {
  for (const double level : {0.0, 1.0}) {
    v1::Solid& solid = *plan.add_solids();
    for (int c = 0; c < 3; ++c) solid.add_colour(level);
  }
  v1::SquareWaves& waves = *plan.mutable_square_waves();
  waves.set_first_level(bars.first_level);
  waves.set_levels(bars.levels);
  waves.set_without_complements(true);
}

double rounded(double value) {
  return std::round(100.0 * value) / 100.0;
}

// The longest monitor represents all.
const v1::Monitor& longest(const RigLimits& rig) {
  return *std::ranges::max_element(rig.monitors, {}, [](const v1::Monitor& monitor) {
    return std::max(monitor.width_px(), monitor.height_px());
  });
}

absl::StatusOr<ExpectedErrors> expected_of(const v1::Plan& plan, const v1::Monitor& monitor,
                                           const DesignWish& wish) {
  GW_ASSIGN_OR_RETURN(std::vector<ShownPattern> patterns, shown_by(plan, monitor));
  return expected_errors(PatternAnswers(std::move(patterns), extent_of(monitor)), wish.noise, *wish.prior);
}

v1::Plan blank_plan(const RigLimits& rig, const Bars& bars) {
  v1::Plan plan;
  plan.set_method("gaussian");
  for (const v1::Monitor& monitor : rig.monitors) {
    v1::PlanMonitor& planned = *plan.add_monitors();
    planned.set_name(monitor.name());
    planned.set_width_px(monitor.width_px());
    planned.set_height_px(monitor.height_px());
  }
  add_stage(bars, plan);
  return plan;
}

absl::StatusOr<Candidate> best_waves(const DesignWish& wish, const RigLimits& rig, const Bars& bars,
                                     int images) {
  const v1::Monitor& monitor = longest(rig);
  const std::vector<double> phi_deg(kDirections_deg.begin(), kDirections_deg.end());
  const double shortest_px = best_shortest_px(extent_of(monitor), phi_deg, images / 2, kFinestPeriod_px,
                                              wish.noise, *wish.prior, {});
  Candidate candidate{
      .plan = blank_plan(rig, bars),
      .words = fmt::format("sinusoids of {} periods, the shortest {:g} px", images / 2, rounded(shortest_px)),
      .expected = {}};
  *candidate.plan.mutable_fringes() =
      fringes_of(wave_ladder(extent_of(monitor), phi_deg, images / 2, shortest_px));
  GW_ASSIGN_OR_RETURN(candidate.expected, expected_of(candidate.plan, monitor, wish));
  return candidate;
}

absl::StatusOr<Candidate> waves_of_shapes(const DesignWish& wish, const RigLimits& rig, const Bars& bars,
                                          int images) {
  const v1::Monitor& monitor = longest(rig);
  const std::vector<DesignedWave> waves =
      shape_waves(extent_of(monitor), images / 2, std::max(kFinestShape_px, 2.0 * rig.blur_px), wish.noise);
  Candidate candidate{.plan = blank_plan(rig, bars), .words = {}, .expected = {}};
  *candidate.plan.mutable_fringes() = fringes_of(waves);
  candidate.words = fmt::format("sinusoids of {} periods in {} directions, the shortest {:g} px",
                                waves.size(), candidate.plan.fringes_size(),
                                std::ranges::min(waves, {}, &DesignedWave::period_px).period_px);
  GW_ASSIGN_OR_RETURN(candidate.expected, expected_of(candidate.plan, monitor, wish));
  return candidate;
}

// Stripes as narrow as the count allows; nothing if even the widest need more images.
absl::StatusOr<std::optional<Candidate>> best_stripes(const DesignWish& wish, const RigLimits& rig,
                                                      const Bars& bars, int images) {
  std::optional<Candidate> best;
  for (const int directions : {3, 4}) {
    for (const double step : {0.7, 1.1}) {
      const auto plan_at = [&](double sigma_px) {
        v1::Plan plan = blank_plan(rig, bars);
        for (const double phi_deg : std::span(kDirections_deg).first(directions)) {
          v1::Sweep& sweep = *plan.add_sweeps();
          sweep.set_orientation_deg(phi_deg);
          sweep.set_sigma_px(sigma_px);
          sweep.set_step_px(rounded(step * sigma_px));
          sweep.set_margin_sigmas(kMargin);
        }
        return plan;
      };
      const int most = images + bars.images() + 2;
      const auto fits = [&](double sigma_px) {
        return images_of(plan_at(sigma_px), rig) <= most * std::ssize(rig.monitors);
      };
      double sigma_px = std::max(1.0, rig.blur_px);
      while (sigma_px <= 200.0 && !fits(sigma_px)) sigma_px *= 1.03;
      if (sigma_px > 200.0) continue;
      Candidate candidate{.plan = plan_at(rounded(sigma_px)),
                          .words = fmt::format("stripes of sigma {:g} px, {:g} sigma apart, in {} directions",
                                               rounded(sigma_px), step, directions),
                          .expected = {}};
      GW_ASSIGN_OR_RETURN(candidate.expected, expected_of(candidate.plan, longest(rig), wish));
      if (!best || candidate.expected.composite < best->expected.composite) best = std::move(candidate);
    }
  }
  return best;
}

}  // namespace

FootprintPrior usual_prior(const MonitorExtent& extent, int modes, double blur_px) {
  constexpr double kUsualSide_px = 128.0;
  const double scale = std::sqrt(std::max(extent.width_px, extent.height_px) / kUsualSide_px);
  const double low_px = std::max(FootprintPrior{}.low_px * scale, blur_px);
  return {
      .modes = modes, .low_px = low_px, .high_px = std::max(FootprintPrior{}.high_px * scale, 2.0 * low_px)};
}

std::vector<Footprints> footprints_of(const FootprintPrior& prior, const MonitorExtent& extent) {
  std::mt19937 random(1);
  const auto uniform = [&](double low, double high) {
    // std::uniform_real_distribution differs between libraries.
    return low + (high - low) * static_cast<double>(random()) / 4294967296.0;
  };
  std::vector<Footprints> all;
  for (int i = 0; i < kDraws; ++i) {
    Footprints modes;
    const int count = 1 + i % prior.modes;
    std::vector<double> parts;
    double sum = 0.0;
    for (int m = 0; m < count; ++m) sum += parts.emplace_back(uniform(0.0, 1.0));
    for (const double part : parts) {
      const double weight =
          kLight * (kLeastWeight + (1.0 - count * kLeastWeight) * (sum > 0.0 ? part / sum : 1.0 / count));
      const auto sigma = [&] {
        return prior.low_px * std::pow(prior.high_px / prior.low_px, uniform(0.0, 1.0));
      };
      const double a = std::pow(sigma(), 2), b = std::pow(sigma(), 2), turn = uniform(0.0, std::numbers::pi);
      const double c = std::cos(turn), s = std::sin(turn);
      modes.push_back({.weight = weight,
                       .x_px = extent.width_px * uniform(0.15, 0.85),
                       .y_px = extent.height_px * uniform(0.15, 0.85),
                       .xx_px2 = a * c * c + b * s * s,
                       .xy_px2 = (a - b) * c * s,
                       .yy_px2 = a * s * s + b * c * c});
    }
    all.push_back(modes);
  }
  return all;
}

Eigen::MatrixXd expected_covariance(const PatternAnswers& patterns, const Footprints& modes,
                                    const CameraNoise& noise, const FootprintPrior& prior,
                                    std::span<const double> noise_scale) {
  const Eigen::MatrixXd by = whitened_slopes(patterns, modes, noise, noise_scale);
  const Eigen::MatrixXd information =
      by.transpose() * by + prior_information(modes.size(), patterns.extent(), prior.high_px);
  return information.inverse().bottomRightCorner(by.cols() - 1, by.cols() - 1);
}

ExpectedErrors expected_errors(const PatternAnswers& patterns, const CameraNoise& noise,
                               const FootprintPrior& prior, std::span<const double> noise_scale) {
  const Background background(patterns.extent());
  std::vector<double> centre, width, weight;
  double log_composite = 0.0;
  const std::vector<Footprints> all = footprints_of(prior, patterns.extent());
  for (const Footprints& modes : all) {
    const Eigen::MatrixXd covariance = expected_covariance(patterns, modes, noise, prior, noise_scale);
    for (int m = 0; m < modes.size(); ++m) {
      const Eigen::Index at = 6 * m;
      centre.push_back(std::sqrt(0.5 * (covariance(at + 1, at + 1) + covariance(at + 2, at + 2))));
      weight.push_back(std::sqrt(covariance(at, at)));
      const double sigma = std::sqrt(0.5 * (modes[m].xx_px2 + modes[m].yy_px2));
      const double both =
          covariance(at + 3, at + 3) + covariance(at + 5, at + 5) + 2.0 * covariance(at + 3, at + 5);
      width.push_back(std::sqrt(both) / (4.0 * sigma));
    }
    const double error = (covariance * background.weight(modes)).trace();
    log_composite += 0.5 * std::log(error) / static_cast<double>(all.size());
  }
  return {.centre_px = median(centre),
          .width_px = median(width),
          .weight = median(weight),
          .composite = std::exp(log_composite)};
}

absl::StatusOr<std::vector<ShownPattern>> shown_by(const v1::Plan& plan, const v1::Monitor& monitor) {
  v1::Plan alone = plan;
  alone.clear_monitors();
  alone.clear_exposure_ms();
  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps, expand(alone, {monitor}));
  std::vector<ShownPattern> patterns;
  for (const Step& step : steps) {
    const v1::Stimulus& stimulus = step.stimulus;
    if (!step.object) continue;
    ShownPattern pattern;
    switch (kind_of(stimulus)) {
      case StimulusKind::kSolid:
        if (stimulus.colour(0) <= 0.0) continue;
        break;
      case StimulusKind::kSquare:
        pattern.lit = {.bars = true,
                       .horizontal = stimulus.orient() == "horizontal_bars",
                       .bar_px = stimulus.bar_width_px(),
                       .inverse = stimulus.inverse()};
        break;
      case StimulusKind::kStripe: {
        const double phi_rad = stimulus.phi_deg() * std::numbers::pi / 180.0;
        pattern.kind = ShownPattern::Kind::kStripe;
        pattern.axis = {
            .cos_phi = std::cos(phi_rad), .sin_phi = std::sin(phi_rad), .sigma_px = stimulus.sigma_px()};
        pattern.r_px = stimulus.r_px();
        break;
      }
      case StimulusKind::kSinusoid:
        pattern = wave_of({.phi_deg = stimulus.phi_deg(), .period_px = stimulus.period_px()},
                          stimulus.phase_deg() * std::numbers::pi / 180.0);
        break;
      default:
        continue;
    }
    patterns.push_back(pattern);
  }
  return patterns;
}

std::vector<ShownPattern> coarse_stage(const MonitorExtent& extent) {
  return stage_of(extent, {});
}

ExpectedErrors expected_of_waves(const MonitorExtent& extent, const std::vector<DesignedWave>& waves,
                                 const CameraNoise& noise, const FootprintPrior& prior,
                                 const WaveNoiseScale& noise_scale) {
  std::vector<ShownPattern> patterns = coarse_stage(extent);
  std::vector<double> scale(patterns.size(), 1.0);
  for (const DesignedWave& wave : waves) {
    add_phases(wave, patterns);
    scale.resize(patterns.size(), noise_scale ? noise_scale(wave) : 1.0);
  }
  constexpr double kNone = std::numeric_limits<double>::infinity();
  if (!std::ranges::all_of(scale, [](double own) { return std::isfinite(own); }))
    return {kNone, kNone, kNone, kNone};
  return expected_errors(PatternAnswers(std::move(patterns), extent), noise, prior, scale);
}

double best_shortest_px(const MonitorExtent& extent, const std::vector<double>& phi_deg, int count,
                        double finest_px, const CameraNoise& noise, const FootprintPrior& prior,
                        const WaveNoiseScale& noise_scale) {
  double best_px = finest_px, least = std::numeric_limits<double>::infinity();
  const double side_px = std::max(extent.width_px, extent.height_px);
  for (double shortest_px = finest_px; shortest_px < 0.5 * side_px; shortest_px *= kPeriodStep) {
    const std::vector<DesignedWave> waves = wave_ladder(extent, phi_deg, count, shortest_px);
    // A longer step could end in a wrong period.
    if (ratio_of(waves) > kMostRatio) continue;
    const ExpectedErrors expected = expected_of_waves(extent, waves, noise, prior, noise_scale);
    if (expected.composite >= least) continue;
    least = expected.composite;
    best_px = shortest_px;
  }
  return best_px;
}

CameraNoise noise_of(const v1::Camera& camera) {
  CameraNoise noise;
  if (camera.read_sd() > 0.0) noise.read_sd = camera.read_sd();
  if (camera.gain() > 0.0) noise.full_well = 1.0 / camera.gain();
  return noise;
}

absl::StatusOr<DesignedPlan> design_plan(const DesignWish& wished, const RigLimits& rig) {
  if (rig.monitors.empty())
    return absl::InvalidArgumentError(
        "there is no monitor for which to design a plan; name one: --monitor back:1920x1080");
  DesignWish wish = wished;
  if (!wish.prior) wish.prior = usual_prior(extent_of(longest(rig)), wish.modes, rig.blur_px);
  const int monitors = static_cast<int>(rig.monitors.size());
  if (wish.images < kMinDesignImages * monitors) {
    return absl::InvalidArgumentError(
        fmt::format("images is {}; it must be at least {}, with and without the object, for {} monitor{}",
                    wish.images, kMinDesignImages * monitors, monitors, monitors == 1 ? "" : "s"));
  }
  Bars bars;
  const auto left = [&] { return wish.images / monitors - 2 * (bars.images() + 2); };
  // Few images leave none for coarse bars.
  while (left() < bars.images() + 12 && bars.first_level < bars.levels) ++bars.first_level;
  GW_ASSIGN_OR_RETURN(Candidate waves, wish.any_footprints ? waves_of_shapes(wish, rig, bars, left())
                                                           : best_waves(wish, rig, bars, left()));
  std::optional<Candidate> stripes;
  if (!wish.any_footprints) {
    GW_ASSIGN_OR_RETURN(stripes, best_stripes(wish, rig, bars, left()));
  }
  DesignedPlan design;
  const bool striped = stripes && stripes->expected.composite < waves.expected.composite;
  Candidate& best = striped ? *stripes : waves;
  if (stripes) {
    design.other = striped ? waves.words : stripes->words;
    design.other_expected = striped ? waves.expected : stripes->expected;
  }
  design.prior = *wish.prior;
  design.plan = std::move(best.plan);
  design.chosen = std::move(best.words);
  design.expected = best.expected;
  GW_RETURN_IF_ERROR(fit_to_camera(rig, design.plan));
  GW_RETURN_IF_ERROR(check_plan(design.plan));
  return design;
}

}  // namespace glasswing
