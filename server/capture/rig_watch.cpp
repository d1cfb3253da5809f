#include "server/capture/rig_watch.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/pattern/stimulus_kind.h"
#include "server/capture/patch_learning.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

constexpr double kBetween_s = 2.0;   // repeated pictures
constexpr size_t kMinBetween = 48;   // steps: they cost at most 2 %
constexpr size_t kMinSteps = 10;     // of a showing, at the end of which pictures are repeated
constexpr size_t kMaxShown = 20000;  // pictures of a program
constexpr double kBarParts = 16.0;   // of the monitor's side: a good bar width
constexpr double kMoved_px = 0.2, kLight = 0.02, kErrors = 8.0;
constexpr double kMaxSd_px = 0.1, kMaxLightSd = 0.005;  // of what counts as measured
constexpr double kSlow = 0.5;                           // of a change between two consecutive repeats
constexpr int kMaxLightChanges = 3, kMaxRanges = 500;

// How far the width of its bars or half waves is from a good one, as the logarithm of the ratio; none: its
// edges are neither vertical nor horizontal.
std::optional<double> distance(const v1::Stimulus& stimulus, const v1::Monitor& monitor, bool upright) {
  const double side_px = (upright ? monitor.width_px() : monitor.height_px()) / kBarParts;
  const auto from = [side_px](double width_px) { return std::abs(std::log(width_px / side_px)); };
  switch (kind_of(stimulus)) {
    case StimulusKind::kSquare:
      if (upright != (stimulus.orient() == "vertical_bars")) return std::nullopt;
      return from(stimulus.bar_width_px());
    case StimulusKind::kSinusoid:
      if (stimulus.phi_deg() != (upright ? 0.0 : 90.0)) return std::nullopt;
      return from(0.5 * stimulus.period_px());
    default:
      return std::nullopt;
  }
}

std::string shift_text(double right_px, double down_px) {
  std::vector<std::string> parts;
  if (std::abs(right_px) >= 0.05)
    parts.push_back(
        fmt::format("{:.1f} px to the {}", std::abs(right_px), right_px > 0.0 ? "right" : "left"));
  if (std::abs(down_px) >= 0.05)
    parts.push_back(fmt::format("{:.1f} px {}", std::abs(down_px), down_px > 0.0 ? "down" : "up"));
  return fmt::format("{}", fmt::join(parts, " and "));
}

}  // namespace

std::optional<int> RigWatch::picture(const Step& of_group, bool upright) const {
  std::optional<int> best;
  double nearest = std::numeric_limits<double>::max();
  for (const Step& step : setup_.steps) {
    if (step.object != of_group.object || step.exposure_ms != of_group.exposure_ms) continue;
    // For one monitor, the one that the plan lights first.
    if (step.stimulus.panel() != of_group.stimulus.panel()) continue;
    const auto monitor = std::ranges::find(setup_.monitors, step.stimulus.panel(), &v1::Monitor::name);
    if (monitor == setup_.monitors.end()) continue;
    const std::optional<double> away = distance(step.stimulus, *monitor, upright);
    if (!away || *away >= nearest) continue;
    nearest = *away;
    best = step.number;
  }
  return best;
}

std::vector<Step> RigWatch::with_repeats(const std::vector<Step>& steps, int hold_refreshes,
                                         const std::set<int>& proven) {
  if (order_.empty()) order_.assign(proven.begin(), proven.end());
  std::vector<Step> shown;
  if (steps.empty()) return shown;
  Seen& seen = seen_.try_emplace({steps.front().object, steps.front().exposure_ms}).first->second;
  if (!seen.known) seen.place.fill(order_.size());
  double refresh_hz = std::numeric_limits<double>::max();
  for (const v1::Monitor& monitor : setup_.monitors) refresh_hz = std::min(refresh_hz, monitor.refresh_hz());
  const size_t between =
      std::max(kMinBetween, static_cast<size_t>(kBetween_s * refresh_hz / std::max(hold_refreshes, 1)));
  const std::array<std::optional<int>, 2> pictures{picture(steps.front(), true),
                                                   picture(steps.front(), false)};
  const auto repeat = [&](const std::optional<int>& step) {
    if (!step || shown.size() + 2 * (steps.size() / between) + 2 > kMaxShown) return;
    Step again = setup_.step(*step);
    again.number = kFirstRepeat + static_cast<int>(repeats_.size());
    repeats_.push_back(
        {.step = *step, .place = order_.size(), .object = again.object, .exposure_ms = again.exposure_ms});
    shown.push_back(std::move(again));
  };
  size_t turn = 0, since = 0;
  for (const Step& step : steps) {
    shown.push_back(step);
    if (!proven.contains(step.number)) order_.push_back(step.number);
    if (++since < between) continue;
    since = 0;
    repeat(pictures[turn++ % 2]);
  }
  if (steps.size() < kMinSteps) return shown;
  for (const std::optional<int>& step : pictures) repeat(step);
  return shown;
}

std::vector<RigWatch::Comparison> RigWatch::comparisons(const std::vector<v1::Frame>& repeats,
                                                        const std::set<int>& proven) const {
  std::vector<Comparison> comparisons;
  for (const v1::Frame& frame : repeats) {
    const int step = repeats_.at(static_cast<size_t>(frame.step() - kFirstRepeat)).step;
    if (!proven.contains(step)) continue;
    Comparison& comparison = comparisons.emplace_back();
    comparison.repeat = frame.step();
    comparison.frames.set_reference_step(step);
    comparison.frames.set_sequence(frame.sequence());
  }
  return comparisons;
}

bool RigWatch::add(int number, const v1::FrameChange& change, double seconds) {
  const Repeat& repeat = repeats_.at(static_cast<size_t>(number - kFirstRepeat));
  Seen& seen = seen_.at({repeat.object, repeat.exposure_ms});
  newest_ = std::max(newest_, repeat.place);
  if (!change.known()) return false;
  seen.known = true;
  const Quantities now{change.dx_px(), change.dy_px(), change.gain(), change.offset()};
  const Quantities sd{change.dx_sd_px(), change.dy_sd_px(), change.gain_sd(), change.offset_sd()};
  bool changed = false;
  for (const bool of_place : {true, false}) {
    Change found{.of_place = of_place,
                 .slow = true,
                 .good = repeat.place,
                 .bad = repeat.place,
                 .over = std::nullopt,
                 .object = repeat.object,
                 .seconds = seconds};
    bool moved = false, back = true;
    for (const size_t q : of_place ? std::array{kRight, kDown} : std::array{kGain, kOffset}) {
      if (sd[q] > (of_place ? kMaxSd_px : kMaxLightSd)) continue;
      const double enough = std::max(of_place ? kMoved_px : kLight, kErrors * sd[q]);
      if (std::abs(now[q] - seen.level[q]) > enough) {
        moved = true;
        found.by[q] = now[q] - seen.level[q];
        found.good = std::min(found.good, seen.place[q]);
        found.slow = found.slow && std::abs(now[q] - seen.last[q]) < kSlow * std::abs(found.by[q]);
        back = back && std::abs(now[q] - kAtFirst[q]) < 0.5 * enough;
        seen.level[q] = now[q];
      }
      seen.last[q] = now[q];
      seen.place[q] = repeat.place;
    }
    if (moved) changed = note(std::move(found), back) || changed;
  }
  // While the light persists, it spoils more steps.
  const bool lasts =
      std::ranges::any_of(changes_, [](const Change& each) { return !each.of_place && !each.over; });
  return changed || lasts;
}

bool RigWatch::note(Change change, bool back) {
  // Solvers divide out slow changes of light.
  if (change.slow && !change.of_place) return false;
  for (Change& open : changes_) {
    if (open.of_place != change.of_place || open.over || open.slow != change.slow) continue;
    if (back) {
      open.over = change.bad;
      return true;
    }
    // The other direction of the same knock, which the next repeat shows.
    if (change.of_place && (change.good <= open.bad || change.slow)) {
      for (size_t q = 0; q < kQuantities; ++q) open.by[q] += change.by[q];
      open.bad = change.bad;
      return true;
    }
  }
  if (back) return false;  // to how it was before a change that was over
  changes_.push_back(std::move(change));
  return true;
}

std::string RigWatch::steps_text(size_t first, size_t last) const {
  if (order_.empty()) return "";
  const auto at = [this](size_t place) { return order_[std::min(place, order_.size() - 1)]; };
  return fmt::format("{} and {}", at(first), at(std::max(last, first + 1) - 1));
}

void RigWatch::lose(size_t first, size_t last, bool patches, v1::RigChange& told) const {
  std::set<int> steps;
  for (size_t place = first; place < std::min(last, order_.size()); ++place) {
    if (patches || !is_patch_learning_step(setup_.step(order_[place]))) steps.insert(order_[place]);
  }
  for (const int step : steps) {
    auto& ranges = *told.mutable_lost();
    if (!ranges.empty() && ranges.rbegin()->last() + 1 == step) {
      ranges.rbegin()->set_last(step);
    } else {
      v1::StepRange& range = *ranges.Add();
      range.set_first(step);
      range.set_last(step);
    }
  }
  if (told.lost_size() <= kMaxRanges) return;
  told.clear_lost();
  v1::StepRange& all = *told.add_lost();
  all.set_first(*steps.begin());
  all.set_last(*steps.rbegin());
}

void RigWatch::tell_place(const Change& change, const std::string& session, v1::RigChange& told) const {
  const std::string shift = shift_text(change.by[kRight], change.by[kDown]);
  if (change.slow) {
    told.set_what(fmt::format("the picture creeps, by {} so far: the camera or its stand is sinking", shift));
    told.set_advice("secure the camera's stand, then capture again");
    return;
  }
  if (change.over) {
    told.set_what(fmt::format("between steps {} everything was shifted {}: {}, and came back",
                              steps_text(change.good, *change.over), shift, kTouched));
    lose(change.good, *change.over, false, told);
    told.set_advice("capture these steps again: glasswing retake " + session);
    return;
  }
  told.set_what(fmt::format("between steps {} everything moved {}: {}", steps_text(change.good, change.bad),
                            shift, kTouched));
  const bool all = by_hand_ && change.object;
  lose(0, change.bad, true, told);
  if (all) {
    told.clear_lost();
    told.add_lost()->set_last(static_cast<int>(setup_.steps.size()) - 1);
  }
  told.set_advice(fmt::format("leave it where it is now, and capture {} again: glasswing retake {}",
                              all ? "all steps" : "the steps before", session));
}

void RigWatch::tell_light(const Change& change, const std::string& session, v1::RigChange& told) const {
  const double gain = change.by[kGain], offset = change.by[kOffset];
  const bool added = std::abs(offset) >= std::abs(gain);
  const std::string what =
      added ? fmt::format("everything {} {:.0f} % of white {}: a door or a lamp", change.over ? "was" : "is",
                          100.0 * std::abs(offset), offset > 0.0 ? "brighter" : "darker")
            : fmt::format(
                  "the light {} {:.0f} % {}: the camera's exposure or gain, or the "
                  "monitor's brightness, changed",
                  change.over ? "was" : "is", 100.0 * std::abs(gain), gain > 0.0 ? "stronger" : "weaker");
  if (change.over) {
    told.set_what(fmt::format("between steps {} {}", steps_text(change.good, *change.over), what));
    lose(change.good, *change.over, false, told);
    told.set_advice("capture these steps again: glasswing retake " + session);
  } else if (added) {
    told.set_what(fmt::format("since between steps {} {}", steps_text(change.good, change.bad), what));
    lose(change.good, newest_, false, told);
    told.set_advice("restore it, then recapture the steps since then: glasswing retake " + session);
  } else {
    told.set_what(fmt::format("since between steps {} {}", steps_text(change.good, change.bad), what));
    lose(0, change.bad, false, told);
    told.set_advice("switch off automatic controls, then recapture the earlier steps: glasswing retake " +
                    session);
  }
}

v1::RigChange RigWatch::told(const Change& change, const std::string& session) const {
  v1::RigChange told;
  told.set_seconds(change.seconds);
  change.of_place ? tell_place(change, session, told) : tell_light(change, session, told);
  return told;
}

std::vector<v1::RigChange> RigWatch::changes(const std::string& session) const {
  std::vector<v1::RigChange> all;
  const auto of_light = std::ranges::count_if(changes_, [](const Change& each) { return !each.of_place; });
  for (const Change& change : changes_) {
    if (change.of_place || of_light <= kMaxLightChanges) {
      all.push_back(told(change, session));
      continue;
    }
    if (std::ranges::any_of(
            all, [](const v1::RigChange& each) { return each.advice().ends_with("steady light"); }))
      continue;
    v1::RigChange& unsteady = all.emplace_back();
    unsteady.set_seconds(change.seconds);
    unsteady.set_what(
        fmt::format("the light changed {} times: does a lamp or the monitor flicker?", of_light));
    unsteady.set_advice("capture again in steady light");
  }
  return all;
}

}  // namespace glasswing
