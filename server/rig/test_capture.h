// A few pictures shown and recorded for the rig's own sake: what calibrating and checking have in common.
#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <stop_token>
#include <vector>

#include "server/rig/calibration_store.h"
#include "server/rig/node_streams.h"

namespace glasswing {

struct TestCapture {
  std::vector<DisplayLink*> displays;  // those that play
  std::vector<v1::ProgramStep> steps;  // each display takes the stimuli of its own monitors
  int hold_refreshes = 2;
  double exposure_ms = 0.0;
};

struct TestCaptureRecord {
  struct Shown {
    const DisplayLink* display = nullptr;
    v1::Presentation presentation;  // times are the node's
  };
  std::vector<Shown> shown;
  std::vector<v1::FrameTaken> frames;  // times are the node's
};

// Runs the camera, plays the steps once, and records until a tenth of a second after the last was replaced.
// CANCELLED: stopped.
absl::StatusOr<TestCaptureRecord> run_test_capture(RigLinks& rig, const TestCapture& test, std::stop_token stop);

}  // namespace glasswing
