#include "server/capture/group_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "core/base/status.h"
#include "core/pattern/describe_step.h"
#include "server/rig/rig_findings.h"

namespace glasswing {
namespace {

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
                           CaptureProgress& progress, std::set<std::string>& patches_given_up,
                           double exposure_ms)
    : setup_(setup),
      archive_(archive),
      player_(player),
      progress_(progress),
      // The same after a restart of the server, and of no other server's session.
      recording_(setup.links, exposure_ms,
                 fmt::format("{} {}", progress.session().name(), progress.session().created())),
      learning_(patches_given_up) {}

absl::Status GroupCapture::start(std::stop_token stop) {
  GW_RETURN_IF_ERROR(recording_.wait_running(stop));
  return player_.measure_clocks(8);
}

absl::Status GroupCapture::show(const std::vector<Step>& steps, std::stop_token stop) {
  judged_now_.clear();
  refused_now_.clear();
  unreadable_now_.clear();
  const auto judging = [&](std::vector<v1::Frame> frames) { return judge(std::move(frames), stop); };
  GW_RETURN_IF_ERROR(player_.play(learning_.begin_showing(steps), recording_, judging, stop));
  return stop.stop_requested() ? absl::CancelledError("stopped") : absl::OkStatus();
}

absl::Status GroupCapture::prove(std::vector<Step> steps, std::stop_token stop) {
  const int retries = retries_of(progress_.session().plan());
  for (int showings = 0; !steps.empty(); ++showings) {
    if (showings - learning_.unseen_showings() > retries) {
      progress_.note_unproven(steps);
      return unproven(
          fmt::format("{} steps had no proof after {} retries: {}", steps.size(), retries, listed(steps)),
          steps);
    }
    GW_RETURN_IF_ERROR(show(steps, stop));
    std::erase_if(steps, [this](const Step& step) { return progress_.is_proven(step.number); });
    progress_.update_seconds();
    note_retaken(steps);
    progress_.report();
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> GroupCapture::judge(std::vector<v1::Frame> frames, std::stop_token stop) {
  const std::vector<v1::Frame> learning = learning_.take_learning_frames(std::move(frames));
  if (!learning.empty()) {
    GW_ASSIGN_OR_RETURN(const v1::LearnPatchesResponse learned,
                        archive_.learn_patches(learning, learning_.accepted_unseen(), stop));
    progress_.note_kept(learned.frames(), 0);
    for (const std::string& warning : learning_.note_learned(learned)) progress_.warn(warning);
  }
  const std::optional<std::vector<v1::Frame>> ready = learning_.take_ready_frames();
  if (!ready) return false;
  if (ready->empty()) return true;
  GW_ASSIGN_OR_RETURN(const v1::KeepFramesResponse kept, archive_.keep(*ready, stop));
  for (const v1::Frame& frame : *ready) judged_now_.insert(frame.step());
  refused_now_.insert(kept.refused_steps().begin(), kept.refused_steps().end());
  unreadable_now_.insert(kept.unreadable_steps().begin(), kept.unreadable_steps().end());
  progress_.note_kept(kept.frames(), kept.refused());
  return true;
}

void GroupCapture::note_retaken(const std::vector<Step>& steps) {
  for (const Step& step : steps) {
    if (!learning_.is_held(step.number)) progress_.note_retaken(step.number, cause_of(step));
  }
}

v1::RetakeCause GroupCapture::cause_of(const Step& step) const {
  if (!recording_.was_shown_now(step.number)) return v1::RETAKE_CAUSE_NOT_SHOWN;
  if (!recording_.was_matched_now(step.number))
    return recording_.has_frame_of(step.number) ? v1::RETAKE_CAUSE_OUTSIDE_WINDOW : v1::RETAKE_CAUSE_NO_FRAME;
  if (!judged_now_.contains(step.number)) return v1::RETAKE_CAUSE_PATCH_UNSEEN;
  if (unreadable_now_.contains(step.number)) return v1::RETAKE_CAUSE_ID_UNREADABLE;
  return refused_now_.contains(step.number) ? v1::RETAKE_CAUSE_WRONG_ID : v1::RETAKE_CAUSE_TOO_LATE;
}

absl::Status GroupCapture::unproven(const std::string& what, const std::vector<Step>& steps) const {
  std::map<v1::RetakeCause, int> counts;
  for (const Step& step : steps) ++counts[cause_of(step)];
  const v1::RetakeCause commonest =
      std::ranges::max_element(counts, {}, [](const auto& count) { return count.second; })->first;
  std::string causes;
  for (const auto& [cause, count] : counts)
    causes += fmt::format("{}{}: {}", causes.empty() ? "" : ", ", describe(cause), count);
  const std::string exposures =
      fmt::format(" ({} ms at {} fps)", recording_.exposure_ms(), setup_.links.camera_info.frame_rate_hz());
  return absl::FailedPreconditionError(fmt::format(
      "{}; {}; {}", what, causes,
      retake_advice(commonest) + (commonest == v1::RETAKE_CAUSE_OUTSIDE_WINDOW ? exposures : std::string())));
}

}  // namespace glasswing
