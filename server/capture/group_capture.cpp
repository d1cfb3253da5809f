#include "server/capture/group_capture.h"

#include <fmt/format.h>

#include "core/base/status.h"

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
      recording_(setup.links, exposure_ms),
      learning_(patches_given_up) {}

absl::Status GroupCapture::start(std::stop_token stop) {
  GW_RETURN_IF_ERROR(recording_.wait_running(stop));
  return player_.measure_clocks(8);
}

absl::Status GroupCapture::show(const std::vector<Step>& steps, std::stop_token stop) {
  const auto judging = [this](std::vector<v1::Frame> frames) { return judge(std::move(frames)); };
  GW_RETURN_IF_ERROR(player_.play(learning_.begin_showing(steps), recording_, judging, stop));
  return stop.stop_requested() ? absl::CancelledError("stopped") : absl::OkStatus();
}

absl::Status GroupCapture::prove(std::vector<Step> steps, std::stop_token stop) {
  const int refused_before = progress_.session().refused_count();
  const int retries = retries_of(progress_.session().plan());
  for (int showings = 0; !steps.empty(); ++showings) {
    if (showings - learning_.unseen_showings() > retries) {
      progress_.note_unproven(steps);
      return unproven(
          fmt::format("{} steps had no proof after {} retries: {}", steps.size(), retries, listed(steps)),
          steps.size(), progress_.session().refused_count() - refused_before);
    }
    GW_RETURN_IF_ERROR(show(steps, stop));
    std::erase_if(steps, [this](const Step& step) { return progress_.is_proven(step.number); });
    progress_.update_seconds();
    note_retaken(steps);
    progress_.report();
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> GroupCapture::judge(std::vector<v1::Frame> frames) {
  const std::vector<v1::Frame> learning = learning_.take_learning_frames(std::move(frames));
  if (!learning.empty()) {
    GW_ASSIGN_OR_RETURN(const v1::LearnPatchesResponse learned,
                        archive_.learn_patches(learning, learning_.accepted_unseen()));
    progress_.note_kept(learned.frames(), 0);
    for (const std::string& warning : learning_.note_learned(learned)) progress_.warn(warning);
  }
  const std::optional<std::vector<v1::Frame>> ready = learning_.take_ready_frames();
  if (!ready) return false;
  if (ready->empty()) return true;
  GW_ASSIGN_OR_RETURN(const v1::KeepFramesResponse kept, archive_.keep(*ready));
  progress_.note_kept(kept.frames(), kept.refused());
  return true;
}

void GroupCapture::note_retaken(const std::vector<Step>& steps) {
  for (const Step& step : steps) {
    if (learning_.is_held(step.number)) continue;  // it is not shown again
    const char* why = !recording_.was_shown_now(step.number) ? "it was not shown on all monitors"
                      : !recording_.was_matched_now(step.number)
                          ? "no exposure lay in the time in which it surely was on screen"
                      : is_patch_learning_step(step)
                          ? "its id patch was not seen"
                          : "its frame's pixels showed another id, or it came too late to be kept";
    progress_.note_retaken(step.number, why);
  }
}

absl::Status GroupCapture::unproven(const std::string& what, size_t step_count, int refused) const {
  if (refused > static_cast<int>(step_count)) {
    return absl::FailedPreconditionError(fmt::format(
        "{}; {} frames were right by their times, but their pixels showed another id: the times that "
        "a display or the camera reports are wrong, try glasswing calibrate sync",
        what, refused));
  }
  return absl::FailedPreconditionError(fmt::format(
      "{}; the camera's exposures ({} ms at {} fps) must fit between a picture's settling and the "
      "next one: try a shorter exposure_ms or a larger hold_refreshes",
      what, recording_.exposure_ms(), setup_.links.camera_info.frame_rate_hz()));
}

}  // namespace glasswing
