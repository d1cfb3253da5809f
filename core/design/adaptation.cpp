#include "core/design/adaptation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/status.h"
#include "core/design/plan_design.h"
#include "core/frame/archive.h"
#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr size_t kJudged = 500;   // of the object's pixels
constexpr size_t kDesigned = 64;  // of the pixels that are not known well enough
constexpr double kShare = 0.95;   // of the object's pixels
constexpr int kMinWaves = 6;      // of a round

// This many of them, evenly, or all.
template <typename T>
std::vector<T> some_of(std::vector<T> all, size_t count) {
  if (all.size() <= count) return all;
  std::vector<T> some;
  for (size_t i = 0; i < count; ++i) some.push_back(std::move(all[i * all.size() / count]));
  return some;
}

double light_of(std::span<const Mode> modes) {
  double light = 0.0;
  for (const Mode& mode : modes) light += mode.weight;
  return light;
}

JudgedPixel judged_pixel(const Matte& matte, int x, int y, size_t monitors) {
  int strongest = 0;
  const int channels = matte.is_colourless() ? 1 : kChannels;
  for (int c = 1; c < channels; ++c) {
    if (light_of(matte.modes(x, y, c)) > light_of(matte.modes(x, y, strongest))) strongest = c;
  }
  JudgedPixel pixel(monitors);
  // In order of weight.
  for (const Mode& mode : matte.modes(x, y, strongest)) {
    if (!(mode.weight > 0.0f) || static_cast<size_t>(mode.texture) >= monitors) continue;
    KnownPixel& known = pixel[mode.texture];
    if (known.modes.size() == kMaxFootprints) continue;
    const size_t at = known.modes.size();
    known.weight_sd[at] = mode.weight_sd;
    known.centre_sd_px[at] = mode.centre_sd_px;
    known.modes.push_back(footprint_of(mode));
  }
  for (const PyramidFootprint& pyramid : matte.pyramids(x, y, strongest)) {
    if (static_cast<size_t>(pyramid.texture) < monitors) pixel[pyramid.texture].any_shape = true;
  }
  return pixel;
}

RoundTarget target_of(const v1::Adapt& adapt) {
  if (adapt.has_target_px()) return {.kind = RoundTarget::Kind::kCentre, .error = adapt.target_px()};
  const double db = adapt.has_target_db() ? adapt.target_db() : kDefaultTargetDb;
  return {.kind = RoundTarget::Kind::kComposite, .error = std::pow(10.0, -db / 20.0)};
}

// Patch learning and photos do not count.
int images_of(const std::vector<Step>& steps) {
  return static_cast<int>(std::ranges::count_if(steps, [](const Step& step) {
    const StimulusKind kind = kind_of(step.stimulus);
    return kind != StimulusKind::kPatch && kind != StimulusKind::kPhoto;
  }));
}

// The value that this share of all does not exceed.
double quantile(std::vector<double> values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::ranges::nth_element(values, at);
  return *at;
}

struct Judgement {
  std::vector<JudgedPixel> pixels;    // with their excess
  std::vector<PatternAnswers> shown;  // by monitor
  std::vector<PixelError> errors;     // by pixel, over all monitors
  std::vector<size_t> worst;          // by pixel, the monitor on which it is known least
};

absl::StatusOr<Judgement> judge(std::vector<JudgedPixel> pixels, const v1::Plan& plan,
                                const std::vector<v1::Monitor>& monitors, RoundTarget::Kind kind) {
  Judgement judgement{.pixels = std::move(pixels), .shown = {}, .errors = {}, .worst = {}};
  judgement.errors.resize(judgement.pixels.size());
  judgement.worst.resize(judgement.pixels.size(), 0);
  std::vector<double> least(judgement.pixels.size(), 0.0);
  for (size_t m = 0; m < monitors.size(); ++m) {
    GW_ASSIGN_OR_RETURN(std::vector<ShownPattern> patterns, shown_by(plan, monitors[m]));
    const PatternAnswers& shown = judgement.shown.emplace_back(std::move(patterns), extent_of(monitors[m]));
    std::vector<size_t> seen;
    std::vector<KnownPixel> here;
    for (size_t p = 0; p < judgement.pixels.size(); ++p) {
      if (judgement.pixels[p][m].modes.empty()) continue;
      seen.push_back(p);
      here.push_back(judgement.pixels[p][m]);
    }
    find_excess(shown, here);
    const std::vector<PixelError> errors = errors_of(shown, here);
    for (size_t i = 0; i < seen.size(); ++i) {
      const size_t p = seen[i];
      judgement.pixels[p][m].excess = here[i].excess;
      PixelError& whole = judgement.errors[p];
      whole.composite = std::hypot(whole.composite, errors[i].composite);
      whole.centre_px = std::max(whole.centre_px, errors[i].centre_px);
      if (errors[i].of(kind) < least[p]) continue;
      least[p] = errors[i].of(kind);
      judgement.worst[p] = m;
    }
  }
  return judgement;
}

double share_below(const std::vector<double>& errors, double target) {
  const auto below = std::ranges::count_if(errors, [&](double error) { return error <= target; });
  return static_cast<double>(below) / static_cast<double>(errors.size());
}

// What all but 5 % of them do not exceed.
double decibels_of(std::vector<double> errors) {
  return -20.0 * std::log10(std::clamp(quantile(std::move(errors), kShare), 1e-6, 1.0));
}

void put_findings(const Judgement& judgement, const RoundTarget& target, v1::AdaptedRound& found) {
  std::vector<double> composite, centre_px, any_shape;
  for (size_t p = 0; p < judgement.pixels.size(); ++p) {
    composite.push_back(judgement.errors[p].composite);
    centre_px.push_back(judgement.errors[p].centre_px);
    if (std::ranges::any_of(judgement.pixels[p], &KnownPixel::any_shape))
      any_shape.push_back(composite.back());
  }
  found.set_known_share(
      share_below(target.kind == RoundTarget::Kind::kCentre ? centre_px : composite, target.error));
  found.set_error_db(decibels_of(composite));
  found.set_error_px(std::min(quantile(centre_px, kShare), static_cast<double>(kMaxSide_px)));
  if (any_shape.empty()) return;
  v1::AnyShape& shapes = *found.mutable_any_shape();
  shapes.set_share(static_cast<double>(any_shape.size()) / static_cast<double>(composite.size()));
  shapes.set_known_share(share_below(any_shape, target.error));
  shapes.set_error_db(decibels_of(std::move(any_shape)));
}

// The pixels that are not known well enough, on the monitor with most of them.
struct Uncertain {
  size_t monitor = 0;
  std::vector<KnownPixel> pixels;
};
// `views`: those for which the target does not hold.
Uncertain uncertain_in(const std::vector<const Judgement*>& views, const RoundTarget& target) {
  std::vector<std::vector<std::vector<KnownPixel>>> by_monitor;  // then by view
  std::vector<size_t> counts(views.front()->shown.size(), 0);
  by_monitor.assign(counts.size(), std::vector<std::vector<KnownPixel>>(views.size()));
  for (size_t v = 0; v < views.size(); ++v) {
    const Judgement& view = *views[v];
    for (size_t p = 0; p < view.pixels.size(); ++p) {
      if (view.errors[p].of(target.kind) <= target.error) continue;
      by_monitor[view.worst[p]][v].push_back(view.pixels[p][view.worst[p]]);
      ++counts[view.worst[p]];
    }
  }
  Uncertain uncertain;
  uncertain.monitor = static_cast<size_t>(std::ranges::max_element(counts) - counts.begin());
  for (std::vector<KnownPixel>& of_view : by_monitor[uncertain.monitor]) {
    const std::vector<KnownPixel> some = some_of(std::move(of_view), kDesigned / views.size());
    uncertain.pixels.insert(uncertain.pixels.end(), some.begin(), some.end());
  }
  return uncertain;
}

// For a round, on a rig with this many monitors.
int most_waves(const v1::Plan& plan, size_t monitors, int images) {
  const int at_most = plan.adapt().has_at_most() ? plan.adapt().at_most() : kDefaultAtMost;
  const int used = plan.monitors().empty() ? static_cast<int>(monitors) : plan.monitors_size();
  const int each = 2 * used * std::max(plan.exposure_ms_size(), 1);  // images of a wave
  // Twice the images gain 3 dB; a draft's errors predict little beyond that.
  return std::min(at_most - images, std::max(images, kMinWaves * each)) / each;
}

// `found`: of the view that knows least.
v1::Round round_of(std::vector<DesignedWave> waves, const RoundTarget& target,
                   const v1::AdaptedRound& found) {
  std::ranges::sort(waves, [](const DesignedWave& a, const DesignedWave& b) {
    return a.phi_deg != b.phi_deg ? a.phi_deg < b.phi_deg : a.period_px > b.period_px;
  });
  const std::string asked = target.kind == RoundTarget::Kind::kCentre
                                ? fmt::format("{:g} px", target.error)
                                : fmt::format("{:g} dB", -20.0 * std::log10(target.error));
  v1::Round round;
  *round.mutable_fringes() = fringes_of(waves);
  round.set_why(fmt::format(
      "{:.0f} % of the object's pixels were known to {} after {} images, {:.0f} % are requested; 95 % to "
      "{:.1f} dB and {:.3f} px",
      100.0 * found.known_share(), asked, found.image_count(), 100.0 * kShare, found.error_db(),
      found.error_px()));
  if (found.has_any_shape()) {
    *round.mutable_why() += fmt::format(
        "; {:.0f} % have footprints of any shape, {:.0f} % of which were known, 95 % to {:.1f} dB: waves in "
        "{} directions",
        100.0 * found.any_shape().share(), 100.0 * found.any_shape().known_share(),
        found.any_shape().error_db(), round.fringes_size());
  }
  return round;
}

}  // namespace

void add_pixels_of_object(const Matte& rows, int first_x, int step, size_t monitors,
                          std::vector<JudgedPixel>& pixels) {
  for (int y = 0; y < rows.height_px(); ++y) {
    for (int x = first_x; x < rows.width_px(); x += step) {
      if (!(rows.coverage(x, y) > 0.0f)) continue;
      JudgedPixel pixel = judged_pixel(rows, x, y, monitors);
      if (std::ranges::any_of(pixel, [](const KnownPixel& on) { return !on.modes.empty(); }))
        pixels.push_back(std::move(pixel));
    }
  }
}

absl::StatusOr<Adaptation> adapt(std::vector<JudgedView> views, const v1::Plan& plan,
                                 const std::vector<v1::Monitor>& monitors,
                                 std::span<const DesignedWave> waves) {
  const RoundTarget target = target_of(plan.adapt());
  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps, expand(plan, monitors));
  const int images = images_of(steps);
  Adaptation adaptation;
  std::vector<Judgement> judgements;
  for (JudgedView& view : views) {
    std::vector<JudgedPixel> judged = some_of(std::move(view.pixels), kJudged);
    for (JudgedPixel& pixel : judged) {
      for (KnownPixel& on_monitor : pixel) {
        on_monitor.noise = noise_of(view.camera);
        // Positions are those of Gaussians.
        if (target.kind == RoundTarget::Kind::kCentre) on_monitor.any_shape = false;
      }
    }
    GW_ASSIGN_OR_RETURN(Judgement judgement, judge(std::move(judged), plan, monitors, target.kind));
    v1::AdaptedRound& found = adaptation.found.emplace_back();
    found.set_image_count(images);
    put_findings(judgement, target, found);
    judgements.push_back(std::move(judgement));
  }
  std::vector<const Judgement*> open;
  for (size_t v = 0; v < views.size(); ++v) {
    if (adaptation.found[v].known_share() < kShare) open.push_back(&judgements[v]);
  }
  const int most = most_waves(plan, monitors.size(), images);
  if (open.empty() || most <= 0) return adaptation;
  const Uncertain uncertain = uncertain_in(open, target);
  const PatternAnswers& shown = open.front()->shown[uncertain.monitor];
  std::vector<DesignedWave> possible(waves.begin(), waves.end());
  if (possible.empty())
    possible = usual_waves(shown.extent(), std::ranges::any_of(uncertain.pixels, &KnownPixel::any_shape));
  const v1::AdaptedRound& least =
      *std::ranges::min_element(adaptation.found, {}, &v1::AdaptedRound::known_share);
  adaptation.next = round_of(
      choose_waves(shown, uncertain.pixels, target, std::move(possible), std::min(kMinWaves, most), most),
      target, least);
  return adaptation;
}

}  // namespace glasswing
