#include "server/capture/group_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/status.h"
#include "core/pattern/describe_step.h"
#include "core/process/pause.h"
#include "server/capture/lag_search.h"
#include "server/selftest/rig_findings.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

constexpr nanoseconds kMaxWait = std::chrono::milliseconds(1500);  // for frames after the last step

StallWatch stall_watch_of(const CaptureSetup& setup, const v1::Plan& plan) {
  std::vector<const DisplayLink*> displays;
  for (const auto& display : setup.links.displays) displays.push_back(display.get());
  const nanoseconds frame(std::llround(1e9 / setup.links.camera_info.frame_rate_hz()));
  return {std::max(step_time(displays, hold_refreshes_of(plan)), frame), kMaxWait};
}

v1::RetakeCause commonest(const std::map<v1::RetakeCause, int>& counts) {
  return std::ranges::max_element(counts, {}, [](const auto& count) { return count.second; })->first;
}

std::string listed(const std::vector<Step>& steps) {
  std::string text;
  int count = 0;
  for (const Step& step : steps) {
    if (++count > 10) return text + ", ...";
    text += fmt::format("{}{}", text.empty() ? "" : ", ", step.number);
  }
  return text;
}

}  // namespace

GroupCapture::GroupCapture(CaptureSetup& setup, CaptureArchive& archive, StepPlayer& player,
                           CaptureProgress& progress, RigWatch& watch,
                           std::set<std::string>& patches_given_up, double exposure_ms)
    : setup_(setup),
      archive_(archive),
      player_(player),
      progress_(progress),
      watch_(watch),
      // The same after a restart of the server, but different from other servers' sessions.
      recording_(setup.links, exposure_ms,
                 fmt::format("{} {}", progress.session().name(), progress.session().created())),
      // A held step waits for its own proof.
      learning_(patches_given_up, on_demand() ? 1 : PatchLearning::kOthers),
      stall_(stall_watch_of(setup, progress.session().plan())) {}

absl::Status GroupCapture::start(std::stop_token stop) {
  GW_RETURN_IF_ERROR(recording_.wait_running(stop));
  return player_.measure_clocks(8, stop);
}

absl::Status GroupCapture::show(const std::vector<Step>& steps, std::stop_token stop) {
  return play(learning_.begin_showing(steps), stop);
}

absl::Status GroupCapture::play(const std::vector<Step>& steps, std::stop_token stop) {
  judged_now_.clear();
  refused_now_.clear();
  unreadable_now_.clear();
  // Each patch-learning step is shown twice.
  stall_.begin_program(2 * static_cast<int>(std::ranges::count_if(steps, is_patch_learning_step)));
  const auto judging = [&](std::vector<v1::Frame> frames) -> absl::StatusOr<bool> {
    absl::StatusOr<bool> go_on = true;
    if (!frames.empty()) go_on = judge(std::move(frames), false, stop);
    if (go_on.ok() && !on_demand()) look_for_stall(steps);
    return go_on;
  };
  GW_RETURN_IF_ERROR(player_.play(steps, recording_, judging, stop));
  if (stop.stop_requested()) return absl::CancelledError("stopped");
  return judge({}, true, stop).status();
}

absl::Status GroupCapture::prove(std::vector<Step> steps, std::stop_token stop) {
  const int retries = retries_of(progress_.session().plan());
  for (int showings = 0; !steps.empty(); ++showings) {
    if (showings - learning_.unseen_showings() > retries) {
      progress_.note_unproven(steps);
      return unproven(
          fmt::format("{} steps had no proof after {} retries: {}", steps.size(), retries, listed(steps)),
          steps, stop);
    }
    std::vector<Step> showing = learning_.begin_showing(steps);
    // A repeat's frame is not judged by its pixels, which are the only proof without timestamps.
    if (!on_demand()) {
      showing = watch_.with_repeats(std::move(showing), hold_refreshes_of(progress_.session().plan()),
                                    progress_.proven());
    }
    GW_RETURN_IF_ERROR(play(showing, stop));
    if (const v1::UnseenPatch* const patch = learning_.hopeless()) return contradicted(*patch, steps, stop);
    std::erase_if(steps, [this](const Step& step) { return progress_.is_proven(step.number); });
    progress_.update_seconds();
    note_retaken(steps);
    if (progress_.session().reason().starts_with(kStalled)) say_stalled(steps);
    progress_.report();
  }
  return absl::OkStatus();
}

absl::Status GroupCapture::compare(const std::vector<v1::Frame>& repeats, std::stop_token stop) {
  const std::vector<RigWatch::Comparison> wanted = watch_.comparisons(repeats, progress_.proven());
  if (wanted.empty()) return absl::OkStatus();
  std::vector<v1::FrameComparison> comparisons;
  for (const RigWatch::Comparison& each : wanted) comparisons.push_back(each.frames);
  GW_ASSIGN_OR_RETURN(const std::vector<v1::FrameChange> found,
                      archive_.compare(comparisons, std::move(stop)));
  bool changed = false;
  for (size_t i = 0; i < std::min(wanted.size(), found.size()); ++i)
    changed = watch_.add(wanted[i].repeat, found[i], progress_.seconds()) || changed;
  if (changed) progress_.note_rig_changes(watch_.changes(progress_.session().name()));
  return absl::OkStatus();
}

absl::Status GroupCapture::learn(const std::vector<v1::Frame>& frames, std::stop_token stop) {
  if (frames.empty()) return absl::OkStatus();
  std::vector<std::int64_t> last;
  for (const v1::Frame& frame : frames)
    last.push_back(recording_.last_of_patch(frame.step(), frame.sequence()));
  GW_ASSIGN_OR_RETURN(const v1::LearnPatchesResponse learned,
                      archive_.learn_patches(frames, last, learning_.accepted_unseen(), stop));
  progress_.note_kept(learned.frames(), 0);
  for (const std::string& warning : learning_.note_learned(learned)) progress_.warn(warning);
  return absl::OkStatus();
}

absl::StatusOr<bool> GroupCapture::judge(std::vector<v1::Frame> frames, bool is_over, std::stop_token stop) {
  const auto after_steps = std::stable_partition(frames.begin(), frames.end(), [](const v1::Frame& frame) {
    return !RigWatch::is_repeat(frame.step());
  });
  const std::vector<v1::Frame> repeats(after_steps, frames.end());
  frames.erase(after_steps, frames.end());
  const nanoseconds seen_until = recording_.frames_seen_until().value_or(nanoseconds::min());
  const auto has_left = [&](int step) {
    return is_over || seen_until >= recording_.window_of(step).patch_until;
  };
  GW_RETURN_IF_ERROR(learn(learning_.take_learning_frames(std::move(frames), has_left), stop));
  const std::optional<std::vector<v1::Frame>> ready = learning_.take_ready_frames();
  if (!ready) return false;
  if (!ready->empty()) GW_RETURN_IF_ERROR(keep(*ready, stop));
  GW_RETURN_IF_ERROR(compare(repeats, stop));
  return true;
}

absl::Status GroupCapture::keep(const std::vector<v1::Frame>& frames, std::stop_token stop) {
  GW_ASSIGN_OR_RETURN(const v1::KeepFramesResponse kept, archive_.keep(frames, std::move(stop)));
  for (const v1::Frame& frame : frames) judged_now_.insert(frame.step());
  refused_now_.insert(kept.refused_steps().begin(), kept.refused_steps().end());
  unreadable_now_.insert(kept.unreadable_steps().begin(), kept.unreadable_steps().end());
  progress_.note_kept(kept.frames(), kept.refused());
  return absl::OkStatus();
}

void GroupCapture::note_retaken(const std::vector<Step>& steps) {
  for (const Step& step : steps) {
    if (!learning_.is_held(step.number)) progress_.note_retaken(step.number, cause_of(step));
  }
}

void GroupCapture::look_for_stall(const std::vector<Step>& showing) {
  const v1::Session& session = progress_.session();
  if (!stall_.is_stalled(monotonic_now(), session.proven_count()) || !session.reason().empty()) return;
  say_stalled(showing);
}

void GroupCapture::say_stalled(std::vector<Step> unproven) {
  // The others come later, or would have if the showing had not ended early.
  std::erase_if(unproven, [this](const Step& step) {
    return RigWatch::is_repeat(step.number) || !recording_.was_shown_now(step.number) ||
           learning_.is_held(step.number) || progress_.is_proven(step.number);
  });
  const v1::RetakeCause cause =
      unproven.empty() ? v1::RETAKE_CAUSE_NOT_SHOWN : commonest(causes_of(unproven));
  const std::string reason = fmt::format("{}: {}", kStalled, describe(cause));
  if (reason != progress_.session().reason()) progress_.note_waiting(reason);
}

std::map<v1::RetakeCause, int> GroupCapture::causes_of(const std::vector<Step>& steps) const {
  std::map<v1::RetakeCause, int> counts;
  for (const Step& step : steps) ++counts[cause_of(step)];
  return counts;
}

v1::RetakeCause GroupCapture::cause_of(const Step& step) const {
  if (!recording_.was_shown_now(step.number)) return v1::RETAKE_CAUSE_NOT_SHOWN;
  if (!recording_.was_matched_now(step.number))
    return recording_.has_frame_of(step.number) ? v1::RETAKE_CAUSE_OUTSIDE_WINDOW : v1::RETAKE_CAUSE_NO_FRAME;
  if (!judged_now_.contains(step.number)) return v1::RETAKE_CAUSE_PATCH_UNSEEN;
  if (unreadable_now_.contains(step.number)) return v1::RETAKE_CAUSE_ID_UNREADABLE;
  return refused_now_.contains(step.number) ? v1::RETAKE_CAUSE_WRONG_ID : v1::RETAKE_CAUSE_TOO_LATE;
}

absl::Status GroupCapture::unproven(const std::string& what, const std::vector<Step>& steps,
                                    std::stop_token stop) {
  const std::map<v1::RetakeCause, int> counts = causes_of(steps);
  const v1::RetakeCause cause = commonest(counts);
  std::string causes;
  for (const auto& [each, count] : counts)
    causes += fmt::format("{}{}: {}", causes.empty() ? "" : ", ", describe(each), count);
  std::string advice = retake_advice(cause);
  if (cause == v1::RETAKE_CAUSE_OUTSIDE_WINDOW) {
    advice +=
        fmt::format(" ({} ms at {} fps)", recording_.exposure_ms(), setup_.links.camera_info.frame_rate_hz());
  } else if (on_demand()) {
    advice = "do the files that arrive in the folder belong to the requested pictures?";
  } else if (cause == v1::RETAKE_CAUSE_WRONG_ID || cause == v1::RETAKE_CAUSE_ID_UNREADABLE) {
    GW_ASSIGN_OR_RETURN(const std::string lag, lags(steps.front(), stop));
    if (!lag.empty()) advice = lag;
  }
  return absl::FailedPreconditionError(fmt::format("{}; {}; {}", what, causes, advice));
}

absl::Status GroupCapture::contradicted(const v1::UnseenPatch& patch, const std::vector<Step>& steps,
                                        std::stop_token stop) {
  if (on_demand()) {
    return absl::FailedPreconditionError(
        fmt::format("monitor \"{}\": {}; pictures from a folder are proven only by the id patch: the camera "
                    "must see it in focus and not over-exposed, and exactly one file must arrive for each "
                    "requested picture",
                    patch.monitor(), patch.reason()));
  }
  if (patch.frozen()) {
    return absl::FailedPreconditionError(fmt::format(
        "monitor \"{}\": nothing that the camera sees changes while its pictures are shown; is it switched "
        "on, and does the camera see it? If the camera need not see it, start its display with "
        "--patch-rows {}=0, and its steps are proven by time alone",
        patch.monitor(), patch.monitor()));
  }
  GW_ASSIGN_OR_RETURN(std::string advice, lags(steps.front(), stop));
  if (advice.empty()) advice = "no constant lag explains it";
  return absl::FailedPreconditionError(
      fmt::format("monitor \"{}\": {}; {}", patch.monitor(), patch.reason(), advice));
}

absl::StatusOr<std::string> GroupCapture::lags(const Step& of_group, std::stop_token stop) {
  std::vector<Step> shown;
  std::map<std::string, std::vector<Step>> learning;  // by monitor
  for (const Step& step : setup_.steps) {
    if (!is_patch_learning_step(step) || step.object != of_group.object ||
        step.exposure_ms != of_group.exposure_ms)
      continue;
    learning[step.stimulus.panel()].push_back(step);
    shown.push_back(step);
  }
  GW_RETURN_IF_ERROR(player_.play(
      shown, recording_, [](auto) { return true; }, stop));
  const nanoseconds patience = monotonic_now() + kMaxWait;
  const nanoseconds needed = recording_.frames_seen_until().value_or(nanoseconds(0)) + kLatestLag;
  while (recording_.frames_seen_until().value_or(nanoseconds(0)) < needed && monotonic_now() < patience) {
    if (!pause(stop, std::chrono::milliseconds(10))) return absl::CancelledError("stopped");
    recording_.take_frames();
  }
  recording_.stop_camera();
  std::string text;
  for (const auto& [monitor, steps] : learning) {
    GW_ASSIGN_OR_RETURN(const std::optional<nanoseconds> lag, lag_of(steps, stop));
    if (!lag) continue;
    const auto display = std::ranges::find_if(setup_.links.displays, [&name = monitor](const auto& each) {
      return each->monitor(name) != nullptr;
    });
    text += fmt::format(
        "{}monitor \"{}\" shows each step {:.0f} ms {} than {} reports, or the clock of {} is off by that: "
        "glasswing calibrate sync --monitor {}",
        text.empty() ? "" : "; ", monitor, std::abs(1e-6 * static_cast<double>(lag->count())),
        *lag > nanoseconds(0) ? "later" : "earlier", (*display)->info.name(),
        setup_.links.camera_info.camera().name(), monitor);
  }
  return text;
}

absl::StatusOr<std::optional<nanoseconds>> GroupCapture::lag_of(const std::vector<Step>& learning,
                                                                std::stop_token stop) {
  std::vector<TimeOnScreen> ids;
  for (const Step& step : learning) {
    if (!recording_.was_shown_now(step.number)) return std::nullopt;
    const StableWindow& window = recording_.window_of(step.number);
    ids.push_back({.from = window.from, .until = window.patch_until});
  }
  // Each is shown twice, and reported the second time.
  const nanoseconds showing =
      (ids.back().from - ids.front().from) / (2 * (static_cast<std::int64_t>(ids.size()) - 1));
  for (TimeOnScreen& id : ids) id.from -= showing;
  const auto sees = [&](const std::vector<std::int64_t>& sequences) {
    std::vector<v1::Frame> records(sequences.size());
    for (size_t i = 0; i < records.size(); ++i) {
      records[i].set_sequence(sequences[i]);
      records[i].set_exposure_ms(recording_.exposure_ms());
      *records[i].mutable_stimulus() = learning[i].stimulus;
    }
    return archive_.sees_patch(records, stop);
  };
  GW_ASSIGN_OR_RETURN(const std::optional<nanoseconds> lag, find_lag(ids, recording_.recent_frames(), sees));
  const nanoseconds period(std::llround(1e9 / setup_.links.camera_info.frame_rate_hz()));
  return lag && std::chrono::abs(*lag) > period / 2 ? lag : std::nullopt;
}

}  // namespace glasswing
