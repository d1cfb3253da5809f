#include "server/capture/video_capture.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "server/capture/group_capture.h"

namespace glasswing {

bool VideoCapture::is_video_frame(const Step& step) const {
  return step.object && is_video(progress_.session().plan()) && !is_patch_learning_step(step);
}

std::vector<int> VideoCapture::steps() const {
  std::vector<int> video;
  for (const Step& step : setup_.steps) {
    if (is_video_frame(step)) video.push_back(step.number);
  }
  return video;
}

bool VideoCapture::has_run() const {
  return std::ranges::any_of(steps(), [this](int step) { return progress_.is_proven(step); });
}

absl::Status VideoCapture::check_taken(const std::vector<Step>& frames, GroupCapture& group,
                                       std::stop_token stop) const {
  if (has_run()) return absl::OkStatus();
  return group.unproven(fmt::format("none of the video's {} frames has a proof", frames.size()), frames,
                        stop);
}

void VideoCapture::note_lost(bool broken_off) {
  const std::vector<int> video = steps();
  std::vector<int> lost_indices;
  int run = 0, longest = 0;
  for (size_t i = 0; i < video.size(); ++i) {
    run = progress_.is_proven(video[i]) ? 0 : run + 1;
    longest = std::max(longest, run);
    if (run > 0) lost_indices.push_back(static_cast<int>(i));
  }
  progress_.note_lost(lost_indices, video);
  const int count = static_cast<int>(video.size()), lost = static_cast<int>(lost_indices.size());
  if (broken_off && run > 0) {
    progress_.warn(fmt::format("the video ended early: {} of {} frames{}", count - run, count,
                               lost > run ? fmt::format(", {} of them lost", lost - run) : ""));
  } else if (lost > 0) {
    progress_.warn(
        fmt::format("{} of {} frames of the video were lost, at most {} in a row", lost, count, longest));
  }
}

}  // namespace glasswing
