// The frames of a video (core/pattern/plan). They are shown once, in order: those without a proof are lost.
// An interrupted video is not continued: what was recorded is kept, and the rest is lost too.
#pragma once

#include <absl/status/status.h>

#include <stop_token>
#include <vector>

#include "server/capture/capture_progress.h"
#include "server/capture/capture_setup.h"
#include "server/capture/group_capture.h"

namespace glasswing {

class VideoCapture {
 public:
  // Both arguments are borrowed.
  VideoCapture(const CaptureSetup& setup, CaptureProgress& progress) : setup_(setup), progress_(progress) {}

  bool is_video_frame(const Step& step) const;
  // Some of its frames are proven.
  bool has_run() const;
  // Shows `frames` once, in `group`. FAILED_PRECONDITION: none has a proof. CANCELLED: stopped.
  absl::Status take(const std::vector<Step>& frames, GroupCapture& group, std::stop_token stop);
  // Counts the frames without a proof as lost. `broken_off`: the video had run before this capture began.
  void note_lost(bool broken_off);

 private:
  std::vector<int> steps() const;  // of the video, in order

  const CaptureSetup& setup_;
  CaptureProgress& progress_;
};

}  // namespace glasswing
