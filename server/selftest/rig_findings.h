// The judgements of the rig's self-test: each with figures, and advice on what to change.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/timing/proof.h"
#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/camera_service.pb.h"
#include "glasswing/v1/display_service.pb.h"
#include "glasswing/v1/rig_service.pb.h"
#include "glasswing/v1/session.pb.h"

namespace glasswing {

v1::Finding make_finding(v1::FindingLevel level, const std::string& subject, const std::string& text,
                         const std::string& advice = "");

// The pictures and frames of a test capture, in rig time.
struct TestCaptureTimes {
  struct Shown {
    std::string monitor;
    int step = 0;
    nanoseconds held{};    // from its scan-out to that of the next picture
    nanoseconds period{};  // of the monitor's refreshes
  };
  std::vector<Shown> shown;
  std::vector<StableWindow> windows;  // one a step
  std::vector<FrameTime> frames;
  int hold_refreshes = 2;
  bool triggered = false;      // each exposure is placed in a picture
  nanoseconds exposure{};      // asked for
  nanoseconds frame_period{};  // as the camera declares it
  nanoseconds readout{};
};

v1::Finding judge_flips(const TestCaptureTimes& times);
v1::Finding judge_frames(const TestCaptureTimes& times);
// Whether exposures of this length fit into the windows. `shortest` is the camera's shortest exposure.
v1::Finding judge_window(const TestCaptureTimes& times, nanoseconds exposure, nanoseconds shortest);
v1::Finding judge_proof(const TestCaptureTimes& times);
v1::Finding judge_clocks(const std::vector<std::pair<std::string, nanoseconds>>& errors);
// `learning_steps`: the number of ids shown and proven by time. `unseen`: what the camera node says about the
// patch if it cannot read it; without a reason: it can.
v1::Finding judge_patch(const v1::DisplayMonitor& monitor, int learning_steps, const v1::UnseenPatch& unseen);
// Whether the light of the camera's codes is known. `longest`: exposure that a capture would make.
v1::Finding judge_camera_light(const v1::Camera& camera, const std::optional<v1::CameraCalibration>& measured,
                               nanoseconds longest);
v1::Finding judge_monitor_light(const v1::DisplayMonitor& monitor,
                                const std::optional<v1::DisplayCalibration>& measured);
// What to do about steps repeated for this cause.
std::string retake_advice(v1::RetakeCause cause);
// Whether many of the session's steps were repeated, and why. None: few were.
std::optional<v1::Finding> judge_retakes(const v1::Session& session);
v1::Finding judge_sync(const v1::DisplayMonitor& declared, const std::optional<v1::MonitorSync>& measured);

}  // namespace glasswing
