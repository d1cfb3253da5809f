// What a capture does for a video.
#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "server/capture/capture.h"

namespace glasswing {

absl::Status Capture::take_video(const Group& group, const std::vector<Step>& video, Recording& frames,
                                 std::stop_token stop) {
  const int refused_before = session_.refused_count();
  const auto was_shown = [&frames](const Step& step) { return frames.shown.contains(step.number); };
  // Only a start that came too late is made again: then nothing was shown.
  for (int start = 0; start <= retries_of(session_.plan()) && std::ranges::none_of(video, was_shown);
       ++start) {
    GW_RETURN_IF_ERROR(play(video, frames, stop));
    if (stop.stop_requested()) return absl::CancelledError("stopped");
  }
  if (video_has_run()) return absl::OkStatus();
  return unproven(fmt::format("none of the video's {} frames has a proof", video.size()), group,
                  static_cast<int>(video.size()), session_.refused_count() - refused_before);
}

bool Capture::runs_once(const Step& step) const {
  return step.object && is_video(session_.plan()) && !is_lesson(step);
}

std::vector<int> Capture::video_steps() const {
  std::vector<int> video;
  for (const Step& step : steps_) {
    if (runs_once(step)) video.push_back(step.number);
  }
  return video;
}

bool Capture::video_has_run() const {
  return std::ranges::any_of(video_steps(), [this](int step) { return proven_.contains(step); });
}

void Capture::note_lost(bool broken_off) {
  const std::vector<int> video = video_steps();
  session_.clear_lost_frames();
  int run = 0, longest = 0;
  for (size_t i = 0; i < video.size(); ++i) {
    run = proven_.contains(video[i]) ? 0 : run + 1;
    longest = std::max(longest, run);
    if (run == 0) continue;
    session_.add_lost_frames(static_cast<int>(i));
    tell(video[i], v1::STEP_OUTCOME_LOST);
  }
  const int count = static_cast<int>(video.size()), lost = session_.lost_frames_size();
  if (broken_off && run > 0) {
    warn(fmt::format("the video ended early: {} of {} frames{}", count - run, count,
                     lost > run ? fmt::format(", {} of them lost", lost - run) : ""));
  } else if (lost > 0) {
    warn(fmt::format("{} of {} frames of the video were lost, at most {} in a row", lost, count, longest));
  }
}

}  // namespace glasswing
