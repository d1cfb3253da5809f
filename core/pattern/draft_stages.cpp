#include "core/pattern/draft_stages.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "core/pattern/stimulus_kind.h"

namespace glasswing {
namespace {

constexpr int kMinStripes = 5, kMinDirections = 3;  // needed for a matte from a sweep, and from a monitor
constexpr double kLastStage = 0.9;                  // of all steps

// Monitor, direction, sigma and exposure.
using SweepKey = std::tuple<std::string, double, double, double>;

bool is_stripe(const Step& step) {
  return step.object && kind_of(step.stimulus) == StimulusKind::kStripe;
}

SweepKey sweep_of(const Step& step) {
  const v1::Stimulus& stripe = step.stimulus;
  return {stripe.panel(), stripe.phi_deg(), stripe.sigma_px(), step.exposure_ms};
}

// A stripe's position in the showing order: one pass of all sweeps, then the next.
struct Place {
  bool fine = false;
  int sweep = 0;  // by first appearance

  auto operator<=>(const Place&) const = default;
};

// The stripe spacing of the coarse sweep. `steps` are one sweep's.
int coarseness_of(const std::vector<const Step*>& steps) {
  if (steps.size() < 2) return 1;
  const v1::Stimulus &first = steps[0]->stimulus, &second = steps[1]->stimulus;
  constexpr double kSlack = 1e-9;  // of positions k * step_px
  const double step_px = std::abs(second.r_px() - first.r_px());
  const auto fitting = static_cast<int>(
      std::min(std::floor(kMaxStep_sigmas * first.sigma_px() / std::max(step_px, kSlack) + kSlack), 1000.0));
  return std::clamp(std::min(fitting, static_cast<int>(steps.size()) / kMinStripes), 1, 1000);
}

// By step number.
std::map<int, Place> places_of(const std::vector<Step>& steps) {
  std::map<SweepKey, int> number;
  std::vector<std::vector<const Step*>> sweeps;
  for (const Step& step : steps) {
    if (!is_stripe(step)) continue;
    const auto [known, added] = number.emplace(sweep_of(step), static_cast<int>(sweeps.size()));
    if (added) sweeps.emplace_back();
    sweeps[known->second].push_back(&step);
  }
  std::map<int, Place> places;
  for (size_t s = 0; s < sweeps.size(); ++s) {
    const int every = coarseness_of(sweeps[s]), count = static_cast<int>(sweeps[s].size());
    const int first = (count - 1) % every / 2;  // as much of the margin goes at either end
    for (int i = 0; i < count; ++i) {
      places[sweeps[s][i]->number] = {.fine = i % every != first, .sweep = static_cast<int>(s)};
    }
  }
  return places;
}

std::vector<DraftStage> after_rounds(const std::vector<Step>& shown) {
  std::vector<DraftStage> stages;
  for (size_t i = 0; i < shown.size(); ++i) {
    if (i + 1 == shown.size() || shown[i + 1].round != shown[i].round)
      stages.push_back({.step_count = static_cast<int>(i + 1), .sweep_count = 0});
  }
  return stages;
}

}  // namespace

std::vector<Step> coarse_to_fine(std::vector<Step> steps) {
  const std::map<int, Place> places = places_of(steps);
  std::map<std::string, std::vector<size_t>> slots;  // by monitor
  for (size_t i = 0; i < steps.size(); ++i) {
    if (is_stripe(steps[i])) slots[steps[i].stimulus.panel()].push_back(i);
  }
  for (const auto& [monitor, own] : slots) {
    std::vector<Step> stripes;
    for (const size_t i : own) stripes.push_back(std::move(steps[i]));
    std::ranges::stable_sort(stripes, {}, [&](const Step& step) { return places.at(step.number); });
    for (size_t i = 0; i < own.size(); ++i) steps[own[i]] = std::move(stripes[i]);
  }
  return steps;
}

std::vector<Step> in_order_of_showing(const std::vector<Step>& steps) {
  std::vector<Step> shown;
  for (size_t first = 0, end = 0; first < steps.size(); first = end) {
    const auto same_group = [&](const Step& step) {
      return step.object == steps[first].object && step.round == steps[first].round &&
             step.exposure_ms == steps[first].exposure_ms;
    };
    while (end < steps.size() && same_group(steps[end])) ++end;
    for (Step& step :
         coarse_to_fine({steps.begin() + first, steps.begin() + static_cast<std::ptrdiff_t>(end)}))
      shown.push_back(std::move(step));
  }
  return shown;
}

std::vector<DraftStage> draft_stages(const v1::Plan& plan, const std::vector<Step>& shown) {
  if (plan.method() != "gaussian") return {};
  if (plan.has_adapt()) return after_rounds(shown);
  // Numbered in the plan's order, like coarse_to_fine().
  std::vector<Step> planned = shown;
  std::ranges::sort(planned, {}, &Step::number);
  const std::map<int, Place> places = places_of(planned);
  std::map<Place, int> left;  // stripes that are not shown yet
  for (const auto& [step, place] : places) ++left[place];
  std::map<std::string, std::set<double>> directions;  // of whole sets of stripes, by monitor
  std::set<int> sweeps;
  std::vector<DraftStage> stages;
  const auto last = static_cast<size_t>(kLastStage * static_cast<double>(shown.size()));
  for (size_t i = 0; i < last; ++i) {
    if (!is_stripe(shown[i])) continue;
    const v1::Stimulus& stripe = shown[i].stimulus;
    std::set<double>& swept = directions[stripe.panel()];
    const Place place = places.at(shown[i].number);
    if (--left[place] > 0) continue;
    // A stripe turned by 180 degrees is the same stripe.
    swept.insert(std::fmod(stripe.phi_deg() + 360.0, 180.0));
    sweeps.insert(place.sweep);
    const bool enough =
        std::ranges::all_of(directions, [](const auto& of) { return of.second.size() >= kMinDirections; });
    if (enough)
      stages.push_back(
          {.step_count = static_cast<int>(i + 1), .sweep_count = static_cast<int>(sweeps.size())});
  }
  return stages;
}

int count_sweeps(const std::vector<Step>& steps) {
  std::set<SweepKey> sweeps;
  for (const Step& step : steps) {
    if (is_stripe(step)) sweeps.insert(sweep_of(step));
  }
  return static_cast<int>(sweeps.size());
}

std::string describe(const v1::Draft& draft) {
  const std::string images =
      fmt::format("a draft of {} of {} images", draft.image_count(), draft.planned_image_count());
  if (draft.sweep_count() == 0) return images;
  return fmt::format("{}, {} of {} sweeps", images, draft.sweep_count(), draft.planned_sweep_count());
}

std::string describe(const v1::AdaptedRound& round) {
  const std::string known = fmt::format(
      "after {} images {:.0f} % of the pixels are known well enough; 95 % to {:.1f} dB, {:.3g} px",
      round.image_count(), std::floor(100.0 * round.known_share()), round.error_db(), round.error_px());
  if (!round.has_any_shape()) return known;
  return fmt::format("{}; {:.0f} % are of any shape, {:.0f} % of these known, 95 % to {:.1f} dB", known,
                     100.0 * round.any_shape().share(), std::floor(100.0 * round.any_shape().known_share()),
                     round.any_shape().error_db());
}

}  // namespace glasswing
