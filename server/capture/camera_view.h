// One camera in a capture: what it works with, its session as it advances, and its archive.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/capture/capture_archive.h"
#include "server/capture/capture_progress.h"
#include "server/capture/capture_setup.h"
#include "server/capture/rig_watch.h"
#include "server/capture/video_capture.h"

namespace glasswing {

struct CameraView {
  // `by_hand`: RigWatch's. `log`, `report`: CaptureProgress'.
  CameraView(v1::Session session, StepLog& log, std::function<void(const v1::Session&)> report, bool by_hand)
      : progress(std::move(session), log, std::move(report)), video(setup, progress), watch(setup, by_hand) {}
  // The numbers of the steps to capture.
  std::set<int> pending() const {
    std::set<int> numbers;
    if (!failure.ok()) return numbers;
    const bool video_has_run = video.has_run();
    for (const Step& step : setup.steps) {
      if (!progress.is_proven(step.number) && !(step.object && video_has_run)) numbers.insert(step.number);
    }
    return numbers;
  }
  // It takes pictures only when asked, and only pixels prove them.
  bool on_demand() const { return setup.links.camera_info.on_demand(); }
  CameraView(const CameraView&) = delete;
  CameraView& operator=(const CameraView&) = delete;

  CaptureSetup setup;
  CaptureProgress progress;
  VideoCapture video;
  RigWatch watch;
  std::optional<CaptureArchive> archive;   // once the rig is found
  std::set<std::string> patches_given_up;  // monitors whose steps are proven by time alone
  absl::Status failure;                    // why this camera has left the capture, which goes on without it
};

// All cameras of a capture. Their links share the displays.
using CameraViews = std::vector<std::unique_ptr<CameraView>>;

}  // namespace glasswing
