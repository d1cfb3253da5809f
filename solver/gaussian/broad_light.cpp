#include "solver/gaussian/broad_light.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace glasswing {
namespace {

constexpr int kAcross = 4, kDown = 3;                      // centres of templates
constexpr std::array<double, 3> kWidths{0.08, 0.22, 0.6};  // sigma, of the monitor's longer side
constexpr double kStepShare = 0.125;                       // of the narrowest template's sigma
constexpr double kToldApart = 1e-6;  // the least part of a template that no floor explains
constexpr int kBroadIterations = 40;

}  // namespace

BroadLight::BroadLight(const SampleLayout& layout, std::span<const LitArea> areas,
                       const MonitorExtent& extent)
    : extent_(extent) {
  const double side_px = std::max(extent.width_px, extent.height_px);
  double step_px = INFINITY;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    const size_t last = sweep.first + sweep.count - 1;
    step_px = std::min(step_px, static_cast<double>(layout.offset_px[last]) / (sweep.count - 1));
  }
  group_ = std::max(1, static_cast<int>(kStepShare * kWidths.front() * side_px / step_px));
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    std::vector<double> r_px;
    for (int first = 0; first < sweep.count; first += group_) {
      const int count = std::min(group_, sweep.count - first);
      double sum = 0.0;
      for (int i = first; i < first + count; ++i)
        sum += static_cast<double>(layout.offset_px[sweep.first + i]);
      r_px.push_back(sweep.first_r_px + sum / count);
    }
    layout_.add(sweep.axis, r_px);
  }
  for (const double width : kWidths) {
    for (int i = 0; i < kAcross * kDown; ++i) {
      const double variance = width * side_px * width * side_px;
      Template own{.mode = {.weight = 1.0,
                            .x_px = (i % kAcross + 0.5) * extent.width_px / kAcross,
                            .y_px = (i / kAcross + 0.5) * extent.height_px / kDown,
                            .xx_px2 = variance,
                            .xy_px2 = 0.0,
                            .yy_px2 = variance},
                   .answer = std::vector<float>(layout_.offset_px.size()),
                   .lit = {}};
      LitShare shares(own.mode, extent);
      for (const LitArea& area : areas) own.lit.push_back(shares.of(area).share);
      for (const SampleLayout::Sweep& sweep : layout_.sweeps) {
        for (int k = sweep.first; k < sweep.first + sweep.count; ++k) {
          const double r = sweep.first_r_px + layout_.offset_px[k];
          own.answer[k] = static_cast<float>(response(own.mode, sweep.axis, r, extent));
        }
      }
      templates_.push_back(std::move(own));
    }
  }
}

void BroadLight::average(const PixelSamples& rest, PixelSamples& averaged) const {
  averaged = {.layout = &layout_,
              .y = std::vector<float>(layout_.offset_px.size()),
              .weight = std::vector<float>(layout_.offset_px.size()),
              .areas = rest.areas,
              .floor_weight = rest.floor_weight,
              .floor_answer = std::vector<float>(layout_.offset_px.size()),
              .bound_weight = rest.bound_weight};
  for (size_t s = 0; s < layout_.sweeps.size(); ++s) {
    const SampleLayout::Sweep &fine = rest.layout->sweeps[s], &own = layout_.sweeps[s];
    for (int i = 0; i < fine.count; ++i) {
      const auto from = static_cast<size_t>(fine.first + i), to = static_cast<size_t>(own.first + i / group_);
      averaged.y[to] += rest.weight[from] * rest.y[from];
      averaged.floor_answer[to] += rest.weight[from] * rest.floor_answer[from];
      averaged.weight[to] += rest.weight[from];
    }
  }
  for (size_t i = 0; i < averaged.y.size(); ++i) {
    if (averaged.weight[i] == 0.0f) continue;
    averaged.y[i] /= averaged.weight[i];
    averaged.floor_answer[i] /= averaged.weight[i];
  }
}

std::optional<JointFit> BroadLight::best_template(const PixelSamples& averaged, double enough) const {
  double floors = averaged.floor_weight, floor_products = 0.0;
  for (const AreaSample& area : averaged.areas) {
    floors += area.weight * area.floor_answer * area.floor_answer;
    floor_products += area.weight * area.floor_answer * area.y;
  }
  for (size_t i = 0; i < averaged.y.size(); ++i) {
    const auto u = static_cast<double>(averaged.floor_answer[i]), w = static_cast<double>(averaged.weight[i]);
    floors += w * u * u;
    floor_products += w * u * averaged.y[i];
  }
  std::optional<JointFit> best;
  for (const Template& own : templates_) {
    double mixed = 0.0, squares = 0.0, products = 0.0;
    for (size_t i = 0; i < averaged.areas.size(); ++i) {
      const AreaSample& area = averaged.areas[i];
      mixed += area.weight * area.floor_answer * own.lit[i];
      squares += area.weight * own.lit[i] * own.lit[i];
      products += area.weight * own.lit[i] * area.y;
    }
    for (size_t i = 0; i < averaged.y.size(); ++i) {
      const auto answer = static_cast<double>(own.answer[i]), weighted = answer * averaged.weight[i];
      mixed += weighted * averaged.floor_answer[i];
      squares += weighted * answer;
      products += weighted * averaged.y[i];
    }
    // Without the floor, as in joint_fit.h; nothing may be left of what it explains as well.
    const double alone = squares;
    squares -= mixed * mixed / floors;
    products -= mixed * floor_products / floors;
    const bool told_apart = squares > kToldApart * alone;
    if (!told_apart || products <= 0.0 || products > squares || products * products <= enough * squares)
      continue;
    enough = products * products / squares;
    JointFit& fit = best.emplace();
    fit.modes.push_back(own.mode);
    fit.modes[0].weight = products / squares;
    fit.weight_sd[0] = fit.light_sd = 1.0 / std::sqrt(squares);
    fit.centre_sd_px[0] = INFINITY;
    fit.converged = true;
    fit.floor = (floor_products - mixed * fit.modes[0].weight) / floors;
  }
  return best;
}

bool BroadLight::is_broad(const Footprint& mode) const {
  return mode.weight > 0.0 && mode.weight <= 1.0 &&
         axis_variances(covariance_of(mode)).narrow >= 0.25 * templates_.front().mode.xx_px2;
}

std::optional<BroadLight::Found> BroadLight::find(const PixelSamples& rest, double noise_sd, bool expected,
                                                  PixelSamples& averaged, JointWorkspace& workspace) const {
  average(rest, averaged);
  const double noise = std::max(noise_sd, kMinNoise), variance = noise * noise;
  double count = 1.0;
  for (const float weight : averaged.weight) count += weight > 0.0f ? 1.0 : 0.0;
  // By parameters: a weight and a choice of template; and five more.
  const double enough = expected ? 0.0 : 3.0 * std::log(count) * variance,
               more = 5.0 * std::log(count) * variance;
  std::optional<JointFit> start = best_template(averaged, enough);
  if (!start) return std::nullopt;
  start->weight_sd[0] *= noise;
  start->light_sd *= noise;
  NormalEquations before;
  evaluate(averaged, start->modes, extent_, workspace, before);
  const JointFit fit =
      fit_jointly(averaged, start->modes, extent_, {.max_steps = kBroadIterations}, workspace);
  const bool shaped = fit.converged && is_broad(fit.modes[0]) && before.cost - fit.chi2 > more;
  return shaped ? Found{fit, true} : Found{*start, false};
}

}  // namespace glasswing
