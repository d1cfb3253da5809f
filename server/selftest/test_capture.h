// A few pictures shown and recorded without a session, for calibrating and checking the rig.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <stop_token>
#include <vector>

#include "server/rig/calibration_store.h"
#include "server/rig/node_streams.h"

namespace glasswing {

struct TestCapture {
  std::vector<DisplayLink*> displays;  // that play the steps
  std::vector<v1::ProgramStep> steps;  // each display shows the stimuli of its own monitors
  int hold_refreshes = 2;
  double exposure_ms = 0.0;
  bool triggered = false;  // the camera, as in a capture; else it runs freely
};

struct TestCaptureRecord {
  struct Shown {
    const DisplayLink* display = nullptr;
    v1::Presentation presentation;  // times are the node's
  };
  std::vector<Shown> shown;
  std::vector<v1::FrameTaken> frames;  // times are the node's
};

// Runs the camera, plays the steps once, and records until 0.1 s after the last step was replaced.
// CANCELLED: stopped.
absl::StatusOr<TestCaptureRecord> run_test_capture(RigLinks& rig, const TestCapture& test,
                                                   std::stop_token stop);

}  // namespace glasswing
