#include "solver/gaussian/lane_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/footprint/seen_part.h"
#include "solver/method/clipped_noise.h"

namespace glasswing {
namespace {

constexpr double kMoreThanNoise = 3.0;  // standard errors of what white has beyond modes
constexpr double kLacking = 0.05;       // of white
constexpr int kTurns = 3;               // of finding broad light and fitting the other modes
constexpr int kRounds = 8;              // of fits after the first, with white and bars weighed anew
constexpr int kLong = 60;               // iterations of one that has to leave its start behind
constexpr int kPolish = 12;             // iterations of a fit that had converged without white
constexpr double kSure = 2.0;           // a weight below so many of its standard errors is doubted

bool is_positive(const JointFit& fit) {
  return std::isfinite(fit.floor) && std::all_of(fit.modes.begin(), fit.modes.end(),
                                                 [](const Footprint& mode) { return mode.weight > 0.0; });
}

bool is_too_bright(const Footprint& mode) {
  return mode.weight > kMaxWeight;
}

bool lies_on(const Footprint& mode, const MonitorExtent& extent) {
  return mode.x_px >= 0.0 && mode.y_px >= 0.0 && mode.x_px <= extent.width_px &&
         mode.y_px <= extent.height_px;
}

double noise_of(const LaneSamples& samples) {
  return std::pow(std::max(samples.noise_sd, kMinStep), 2);
}

// How much of white noise explains, at so many standard errors.
double noise_of(const WhiteRest& beyond, double standard_errors) {
  return standard_errors * std::sqrt(beyond.variance) + kBarsError * std::abs(beyond.white);
}

void note(LaneNotes* notes, std::string text) {
  if (notes != nullptr) notes->push_back(std::move(text));
}

std::string described(const JointFit& fit) {
  std::string text;
  for (int m = 0; m < fit.modes.size(); ++m) {
    const Footprint& mode = fit.modes[m];
    const size_t i = m;
    text += fmt::format(
        "\n    R {:.5f} +- {:.5f} at ({:.3f}, {:.3f}) +- {:.3f} px, Sigma ({:.3f}, {:.3f}, {:.3f}) px2",
        mode.weight, fit.weight_sd[i], mode.x_px, mode.y_px, fit.centre_sd_px[i], mode.xx_px2, mode.xy_px2,
        mode.yy_px2);
  }
  return text;
}

}  // namespace

bool contradicts_white(const WhiteRest& beyond) {
  return beyond.known && std::abs(beyond.rest) > noise_of(beyond, kBeyondNoise);
}

bool is_done(const BatchFit& fit, double noise_sd) {
  if (!suffices(fit.all, fit.sweeps, noise_sd)) return false;
  if (std::any_of(fit.all.modes.begin(), fit.all.modes.end(), is_too_bright)) return false;
  return !fit.beyond.known || std::abs(fit.beyond.rest) <= noise_of(fit.beyond, kMoreThanNoise);
}

LaneFit LaneSolver::search(const LaneSamples& samples, const BatchFit* batch, LaneNotes* notes) {
  LaneFit found;
  if (batch != nullptr && suffices(batch->sweeps, batch->sweeps, samples.noise_sd)) {
    found = {.fit = batch->sweeps, .beyond = batch->beyond};
    found.fit.floor += samples.baseline - samples.black;
    note(notes, "the fit of the batch explains the sweeps" + described(found.fit));
    return found;
  }
  const bool usual = batch != nullptr && needs_more(batch->sweeps, samples.noise_sd);
  found.fit = find_footprints(samples.sweeps, samples.peaks, monitor_.extent, samples.noise_sd, max_modes_,
                              workspace_, usual ? &batch->sweeps : nullptr);
  found.fit.floor = samples.baseline - samples.black;
  found.beyond = held_against_white(samples, found.fit);
  note(notes,
       fmt::format("searched for footprints{}: {} explain the sweeps, chi2 {:.1f} of {} samples{}",
                   usual ? ", from the batch's fit" : "", found.fit.modes.size(),
                   found.fit.near_chi2 / noise_of(samples), found.fit.near_count, described(found.fit)));
  return found;
}

PixelSamples LaneSolver::everything(const LaneSamples& samples, const JointFit& fit) const {
  PixelSamples all = samples.sweeps;
  const auto above = static_cast<float>(samples.baseline - samples.black);
  for (size_t i = 0; i < all.y.size(); ++i) all.y[i] += above * all.floor_answer[i];
  all.floor_weight = samples.floor_weight;
  weigh_areas(samples, fit, all);
  return all;
}

// White and bars count less where they may show that the modes are not quite Gaussian; where noise made them
// darker than black, the fit says by how much in the mean.
void LaneSolver::weigh_areas(const LaneSamples& samples, const JointFit& fit, PixelSamples& all) const {
  const double noise = noise_of(samples);
  // White is right for footprints of any shape: it counts more where the sweeps leave more than noise.
  const double residual = std::max(noise, fit.near_chi2 / std::max(fit.near_count, 1));
  std::vector<LitShare> shares;
  for (const Footprint& mode : fit.modes) shares.emplace_back(mode, monitor_.extent);
  all.areas.clear();
  for (size_t a = 0; a < monitor_.areas.size(); ++a) {
    const ShownArea& area = monitor_.areas[a];
    AreaSample& sample =
        all.areas.emplace_back(AreaSample{.lit = area.lit,
                                          .y = (samples.area[a] - samples.black) / area.light,
                                          .weight = 0.0,
                                          .floor_answer = 1.0 / area.light});
    double shape = 0.0, light = samples.black + fit.floor;
    const bool dark = samples.area_variance[a] < 0.0, saturated = std::isinf(samples.area_variance[a]);
    const double own = saturated ? noise : std::abs(samples.area_variance[a]);
    for (int m = 0; m < fit.modes.size(); ++m) {
      const Footprint& mode = fit.modes[m];
      shape += mode.weight * lit_share_error(mode, area.lit, monitor_.extent);
      if (dark || saturated) light += area.light * mode.weight * shares[m].of(area.lit).share;
    }
    if (saturated && light >= samples.area[a]) continue;  // it is at least that
    if (dark) {
      const double sd = std::sqrt(own);
      sample.y = (std::max(light, 0.0) + sd * mean_noise_below(std::max(light, 0.0) / sd) - samples.black) /
                 area.light;
    }
    const double model = area.lit.bars ? kBarsError * std::abs(sample.y) + shape : kWhiteError * sample.y;
    sample.weight = (area.lit.bars ? noise : residual) /
                    (std::max(own, 0.01 * noise) / (area.light * area.light) + model * model);
  }
}

WhiteRest LaneSolver::held_against_white(const LaneSamples& samples, const JointFit& fit) const {
  double modes = 0.0;
  for (const Footprint& mode : fit.modes)
    modes += mode.weight * LitShare(mode, monitor_.extent).of(LitArea{}).share;
  double whole = 0.0, light = 0.0;
  for (size_t a = 0; a < monitor_.areas.size(); ++a) {
    const auto seen = [&](size_t i) {
      return (samples.area[i] - samples.black - fit.floor) / monitor_.areas[i].light;
    };
    const auto variance_of = [&](size_t i) {
      return std::abs(samples.area_variance[i]) / std::pow(monitor_.areas[i].light, 2);
    };
    double white = seen(a), variance = variance_of(a);
    if (monitor_.areas[a].lit.bars) {
      // With their inverse they are white, whatever the shape of footprints.
      if (a + 1 == monitor_.areas.size() || !same_bars(monitor_.areas[a].lit, monitor_.areas[a + 1].lit))
        continue;
      ++a;
      white += seen(a), variance += variance_of(a);
    }
    if (std::isinf(variance)) continue;
    const double weight = 1.0 / std::max(variance + std::pow(kWhiteError * white, 2), 1e-12);
    light += weight * white, whole += weight;
  }
  if (!(whole > 0.0)) return {};
  return {.known = true,
          .white = light / whole,
          .rest = light / whole - modes,
          .variance = 1.0 / whole + std::pow(fit.light_sd, 2)};
}

std::optional<JointFit> LaneSolver::fit_all(const LaneSamples& samples, const Footprints& start,
                                            PixelSamples& all) {
  const auto weights = [&] {
    double sum = 0.0;
    for (const AreaSample& area : all.areas) sum += area.weight;
    return sum;
  };
  Footprints modes = start;
  StepLimits limits{.max_steps = 1, .near = true};  // the first step changes most
  for (int round = 0;; ++round) {
    const JointFit fit = fit_jointly(all, modes, monitor_.extent, limits, workspace_);
    if (!is_positive(fit)) return std::nullopt;
    const double before = weights();
    weigh_areas(samples, fit, all);
    // Narrower footprints trust fine bars more.
    if (round == kRounds || (fit.converged && std::abs(weights() - before) <= 0.2 * before))
      return fit.converged ? std::optional(fit) : std::nullopt;
    modes = fit.modes;
    limits = {.max_steps = kPolish, .near = true};
  }
}

LaneFit LaneSolver::settle(const LaneSamples& samples, LaneFit found, bool expected, LaneNotes* notes) {
  PixelSamples all = everything(samples, found.fit);
  std::optional<JointFit> fit = with_broad_light(samples, found, expected);
  if (fit) note(notes, "white shows more than these: broad light was added" + described(*fit));
  // What modes lack altogether they must not make up for, unless the sweeps agree: a broad mode's light may
  // have been taken for F.
  const bool lacking = found.beyond.rest > kBeyondNoise * std::sqrt(found.beyond.variance) +
                                               kLacking * std::abs(found.beyond.white);
  if (!fit && !found.fit.modes.empty()) {
    fit = fit_all(samples, found.fit.modes, all);
    if (fit && lacking &&
        (!suffices(*fit, *fit, samples.noise_sd) || contradicts_white(held_against_white(samples, *fit))))
      fit.reset();
    if (fit) note(notes, "fitted with white and bars" + described(*fit));
  }
  if (!fit && std::any_of(found.fit.modes.begin(), found.fit.modes.end(), is_too_bright)) {
    // Sweeps alone do not know of the bound.
    const JointFit bounded =
        fit_jointly(all, found.fit.modes, monitor_.extent, {.max_steps = kLong}, workspace_);
    if (is_positive(bounded)) fit = bounded;
  }
  if (!fit) {
    note(notes,
         lacking ? "white shows light that no footprint was found for" : "white and bars fit no better");
    return found;
  }
  return {.fit = *fit, .beyond = held_against_white(samples, *fit)};
}

PixelSamples LaneSolver::left_by(const PixelSamples& all, const Footprints& modes) {
  PixelSamples rest = all;
  NormalEquations equations;
  rest.floor_weight = INFINITY;
  evaluate(rest, modes, monitor_.extent, workspace_, equations);
  rest.y = workspace_.residual;
  rest.floor_weight = all.floor_weight;
  for (size_t i = 0; i < rest.areas.size(); ++i) rest.areas[i].y = workspace_.areas[i].rest;
  return rest;
}

std::optional<JointFit> LaneSolver::with_broad_light(const LaneSamples& samples, const LaneFit& found,
                                                     bool expected) {
  const WhiteRest& beyond = found.beyond;
  if (!beyond.known || found.fit.modes.size() >= max_modes_) return std::nullopt;
  const double noise = noise_of(beyond, kMoreThanNoise);
  if (beyond.rest <= 0.0 || (!expected && beyond.rest < noise)) return std::nullopt;
  PixelSamples all = everything(samples, found.fit);
  // Modes that took some of the broad light for their own give it back in turns.
  Footprints modes = found.fit.modes;
  JointFit fit;
  for (int turn = 0; turn < kTurns; ++turn) {
    const std::optional<BroadLight::Found> broad =
        monitor_.broad->find(left_by(all, modes), samples.noise_sd, expected, averaged_, workspace_);
    if (!broad) return std::nullopt;
    const Footprint& mode = broad->fit.modes[0];
    fit = broad->fit;
    if (modes.empty()) return fit;
    if (broad->shape || beyond.rest > noise) {
      Footprints together = modes;
      together.push_back(mode);
      PixelSamples trial = all;
      const std::optional<JointFit> joint = fit_all(samples, together, trial);
      if (joint && monitor_.broad->is_broad(joint->modes[joint->modes.size() - 1])) return joint;
    }
    fit = fit_jointly(left_by(all, broad->fit.modes), modes, monitor_.extent, {.max_steps = kPolish},
                      workspace_);
    if (!fit.converged || !is_positive(fit)) return std::nullopt;
    modes = fit.modes;
    const size_t last = modes.size();
    fit.weight_sd[last] = broad->fit.weight_sd[0];
    fit.centre_sd_px[last] = broad->fit.centre_sd_px[0];
    fit.light_sd = std::hypot(fit.light_sd, broad->fit.light_sd);
    fit.modes.push_back(mode);
    if (beyond.rest <= noise) break;
  }
  return fit;
}

LaneFit LaneSolver::judge(const LaneSamples& samples, LaneFit settled, LaneNotes* notes) {
  for (int m = settled.fit.modes.size() - 1; m >= 0; --m) {
    JointFit& fit = settled.fit;
    const size_t i = m;
    const bool sure = fit.modes[m].weight > kSure * fit.weight_sd[i];
    if (sure && lies_on(fit.modes[m], monitor_.extent)) continue;
    if (!sure && fit.modes.size() > 1) {
      Footprints fewer = fit.modes;
      fewer.remove(m);
      PixelSamples all = everything(samples, fit);
      NormalEquations now;
      evaluate(all, fit.modes, monitor_.extent, workspace_, now);
      fit.chi2 = now.cost, fit.near_chi2 = now.near_chi2, fit.near_count = now.near_count;
      const std::optional<JointFit> without = fit_all(samples, fewer, all);
      if (without && !earns_its_place(*without, fit, samples.noise_sd)) {
        note(notes, fmt::format("refused: R {:.5f} +- {:.5f}, which the samples do not ask for",
                                fit.modes[m].weight, fit.weight_sd[i]));
        settled = {.fit = *without, .beyond = held_against_white(samples, *without)};
        continue;
      }
    }
    if (sure || lies_on(fit.modes[m], monitor_.extent)) continue;
    const bool held = hold_on_monitor(samples, m, settled);
    note(notes, fmt::format("its centre lies off the monitor and is not known: {}{}",
                            held ? "held at the edge" : "flagged", described(settled.fit)));
  }
  return settled;
}

bool LaneSolver::hold_on_monitor(const LaneSamples& samples, int m, LaneFit& settled) {
  constexpr double kNoWorse = 9.0;  // of chi2: three standard errors
  JointFit& fit = settled.fit;
  const MonitorExtent& extent = monitor_.extent;
  Footprints start = fit.modes;
  Footprint& mode = start[m];
  const Footprint seen = seen_part(mode, extent);
  const double x = std::clamp(mode.x_px, 0.0, extent.width_px),
               y = std::clamp(mode.y_px, 0.0, extent.height_px);
  const unsigned held = (x != mode.x_px ? 2u : 0u) | (y != mode.y_px ? 4u : 0u);
  const double dx = seen.x_px - x, dy = seen.y_px - y;
  mode = with_positive_covariance({.weight = 2.0 * seen.weight,
                                   .x_px = x,
                                   .y_px = y,
                                   .xx_px2 = seen.xx_px2 + dx * dx,
                                   .xy_px2 = seen.xy_px2 + dx * dy,
                                   .yy_px2 = seen.yy_px2 + dy * dy},
                                  1.0);
  const PixelSamples all = everything(samples, fit);
  NormalEquations now;
  evaluate(all, fit.modes, extent, workspace_, now);
  JointFit on = fit_jointly(all, start, extent, {.max_steps = kLong}, workspace_, held << (6 * m));
  if (!is_positive(on) || !on.converged || on.chi2 > now.cost + kNoWorse * noise_of(samples)) {
    fit.converged = false;
    return false;
  }
  const size_t i = m;
  on.centre_sd_px[i] = std::hypot(on.centre_sd_px[i], std::sqrt(0.5 * (seen.xx_px2 + seen.yy_px2)));
  settled = {.fit = on, .beyond = held_against_white(samples, on)};
  return true;
}

bool is_of_another_shape(const Footprints& modes, const SampleLayout& layout) {
  constexpr double kApart = 2.0;   // standard deviations of a peak: below, two of them are one
  constexpr double kPoint = 0.25;  // of a stripe's sigma
  if (modes.size() < kMaxFootprints) return false;
  double narrow = 0.0, light = 0.0;
  for (const Footprint& mode : modes) {
    const double point_px = kPoint * layout.sweeps.front().axis.sigma_px;
    if (0.5 * (mode.xx_px2 + mode.yy_px2) < point_px * point_px) narrow += mode.weight;
    light += mode.weight;
  }
  if (narrow > 0.5 * light) return false;
  const auto apart_in = [&](const StripeAxis& axis, const Footprint& a, const Footprint& b) {
    const double sigma_px = std::sqrt(0.5 * (answered_variance(a, axis) + answered_variance(b, axis)));
    return std::abs((a.x_px - b.x_px) * axis.cos_phi + (a.y_px - b.y_px) * axis.sin_phi) > kApart * sigma_px;
  };
  return std::ranges::none_of(layout.sweeps, [&](const SampleLayout::Sweep& sweep) {
    for (int m = 0; m < modes.size(); ++m) {
      for (int n = 0; n < m; ++n) {
        if (!apart_in(sweep.axis, modes[m], modes[n])) return false;
      }
    }
    return true;
  });
}

double unexplained(const LaneFit& lane, double noise_sd, const SampleLayout& layout) {
  constexpr double kSurely = 5.0;  // standard deviations of chi2
  constexpr double kPoor = 0.05;   // of the highest sample
  const JointFit& fit = lane.fit;
  if (fit.modes.empty()) return 0.0;
  const double n = std::max(fit.near_count, 1), noise = std::max(noise_sd, kMinNoise);
  const double chi2 = fit.near_chi2 / (noise * noise);
  if (chi2 < n + kSurely * std::sqrt(2.0 * n)) return 0.0;
  double highest = 0.0;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (const Footprint& mode : fit.modes)
      highest = std::max(highest,
                         mode.weight * sweep.axis.sigma_px / std::sqrt(answered_variance(mode, sweep.axis)));
  }
  const double rms = std::sqrt(std::max(fit.near_chi2 / n - noise * noise, 0.0));
  return rms > kPoor * highest ? rms / highest : 0.0;
}

}  // namespace glasswing
