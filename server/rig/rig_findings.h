// What the rig's self-test says of what it saw: each judgement by itself, with figures and what to change.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/timing/proof.h"
#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/display_service.pb.h"
#include "glasswing/v1/rig_service.pb.h"

namespace glasswing {

v1::Finding make_finding(v1::FindingLevel level, const std::string& subject, const std::string& text,
                         const std::string& advice = "");

// What a trial showed and recorded, in rig time.
struct TestCaptureTimes {
  struct Shown {
    std::string monitor;
    int step = 0;
    nanoseconds held{};    // from its scan-out to the next picture's
    nanoseconds period{};  // of the monitor's refreshes
  };
  std::vector<Shown> shown;
  std::vector<StableWindow> windows;  // one a step
  std::vector<FrameTime> frames;
  int hold_refreshes = 2;
  nanoseconds exposure{};      // asked for
  nanoseconds frame_period{};  // as the camera says
  nanoseconds readout{};
};

v1::Finding judge_flips(const TestCaptureTimes& times);
v1::Finding judge_frames(const TestCaptureTimes& times);
// Whether exposures of this length fit what the windows leave; `shortest` is the camera's.
v1::Finding judge_window(const TestCaptureTimes& times, nanoseconds exposure, nanoseconds shortest);
v1::Finding judge_proof(const TestCaptureTimes& times);
v1::Finding judge_clocks(const std::vector<std::pair<std::string, nanoseconds>>& errors);
// `lessons`: how many ids were shown and proven by time; `unseen`: what the camera node says against it.
v1::Finding judge_patch(const v1::DisplayMonitor& monitor, int lessons, const std::string& unseen);
// Whether codes are known in light. `longest`: of the exposures that a capture would make.
v1::Finding judge_camera_light(const v1::Camera& camera, const std::optional<v1::CameraCalibration>& measured,
                               nanoseconds longest);
v1::Finding judge_monitor_light(const v1::DisplayMonitor& monitor,
                                const std::optional<v1::DisplayCalibration>& measured);
v1::Finding judge_sync(const v1::DisplayMonitor& declared, const std::optional<v1::MonitorSync>& measured);

}  // namespace glasswing
