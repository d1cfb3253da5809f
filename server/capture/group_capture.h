// One camera's part in capturing a group of steps: those of one stage and one exposure, during which the
// camera runs without interruption. Capture shows the steps to all cameras at once.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <map>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "server/capture/camera_view.h"
#include "server/capture/patch_learning.h"
#include "server/capture/recording.h"
#include "server/capture/stall_watch.h"
#include "server/capture/step_player.h"

namespace glasswing {

class GroupCapture {
 public:
  // Starts the camera. `view`, `player` are borrowed.
  GroupCapture(CameraView& view, StepPlayer& player, double exposure_ms);

  CameraView& view() { return view_; }
  // Returns when the camera is running.
  absl::Status wait_running(std::stop_token stop) { return recording_.wait_running(stop); }

  // The steps to repeat until each is proven.
  void begin(std::vector<Step> steps);
  // Those to show next; empty: all are proven. FAILED_PRECONDITION: some are not after the plan's retries.
  absl::StatusOr<std::vector<Step>> next_showing(std::stop_token stop);
  // Begins a showing of `shown`, of which the camera needs `needed` and the repeated pictures.
  Watching watch(const std::vector<Step>& shown, const std::vector<Step>& needed, std::stop_token stop);
  // Judges the rest of the showing's frames.
  absl::Status end_showing(std::stop_token stop) { return judge({}, true, stop).status(); }
  // Takes stock of next_showing()'s steps. FAILED_PRECONDITION: the camera's pictures contradict the reported
  // times.
  absl::Status note_showing(std::stop_token stop);
  // The camera stops: nothing more is expected of it.
  void stop() { recording_.stop_camera(); }
  // The same for steps that are shown only once: drops what was queued before.
  void begin_once(const std::vector<Step>& steps) { (void)learning_.begin_showing(steps); }
  // The error for `what`: these steps have no proof. Gives advice for the most common cause in the last
  // showing. If that is what the pixels show, measures the lag that would explain it, and stops the camera.
  absl::Status unproven(const std::string& what, const std::vector<Step>& steps, std::stop_token stop);

 private:
  // Makes the camera node store the frames of one batch whose pixels agree. Returns false if a patch-learning
  // step was missed, or nothing was learned from it: frames of later steps cannot be judged, and the showing
  // ends.
  absl::StatusOr<bool> judge(std::vector<v1::Frame> frames, bool is_over, std::stop_token stop);
  absl::Status keep(const std::vector<v1::Frame>& frames, std::stop_token stop);
  // Detects disturbances of the rig from frames of repeated pictures.
  absl::Status compare(const std::vector<v1::Frame>& repeats, std::stop_token stop);
  absl::Status learn(const std::vector<v1::Frame>& frames, std::stop_token stop);
  // The error for a patch that contradicts the reported times, or for a frozen one, while `steps` are shown.
  absl::Status contradicted(const v1::UnseenPatch& patch, const std::vector<Step>& steps,
                            std::stop_token stop);
  // A readable text on how the monitors' patches contradict the reported times; empty: no lag explains it.
  // Repeats the patch-learning steps of the group that contains this step, and stops the camera.
  absl::StatusOr<std::string> lags(const Step& of_group, std::stop_token stop);
  // How far the monitor of these just shown patch-learning steps lags behind its reports; none: unknown, or
  // too little to measure with frames.
  absl::StatusOr<std::optional<nanoseconds>> lag_of(const std::vector<Step>& learning, std::stop_token stop);
  bool on_demand() const { return view_.on_demand(); }
  void note_retaken(const std::vector<Step>& steps);
  // To be called repeatedly while the showing plays.
  void look_for_stall(const std::vector<Step>& showing);
  // Reports in the session that nothing is being proven any more, with the most common cause of these steps.
  void say_stalled(std::vector<Step> unproven);
  // Why the last showing did not prove the step.
  v1::RetakeCause cause_of(const Step& step) const;
  std::map<v1::RetakeCause, int> causes_of(const std::vector<Step>& steps) const;

  CameraView& view_;
  CaptureSetup& setup_;
  CaptureArchive& archive_;
  StepPlayer& player_;
  CaptureProgress& progress_;
  RigWatch& watch_;
  Recording recording_;
  PatchLearning learning_;
  StallWatch stall_;
  std::vector<Step> pending_;
  int showings_ = 0;
  std::set<int> judged_now_, refused_now_, unreadable_now_;  // steps of the current showing
};

}  // namespace glasswing
