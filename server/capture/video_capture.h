// The frames of a video (core/pattern/plan). They are shown once, in order: those without a proof are lost.
// An interrupted video is not continued: what was recorded is kept, and the rest is lost too.
#pragma once

#include <absl/status/status.h>

#include <stop_token>
#include <vector>

#include "server/capture/capture_progress.h"
#include "server/capture/capture_setup.h"

namespace glasswing {

class GroupCapture;

class VideoCapture {
 public:
  // Both arguments are borrowed.
  VideoCapture(const CaptureSetup& setup, CaptureProgress& progress) : setup_(setup), progress_(progress) {}

  bool is_video_frame(const Step& step) const;
  // Some of its frames are proven.
  bool has_run() const;
  // For `frames` that were shown once, in `group`. FAILED_PRECONDITION: none has a proof.
  absl::Status check_taken(const std::vector<Step>& frames, GroupCapture& group, std::stop_token stop) const;
  // Counts the frames without a proof as lost. `broken_off`: the video had run before this capture began.
  void note_lost(bool broken_off);

 private:
  std::vector<int> steps() const;  // of the video, in order

  const CaptureSetup& setup_;
  CaptureProgress& progress_;
};

}  // namespace glasswing
