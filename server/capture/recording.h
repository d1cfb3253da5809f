// The camera, running at one exposure, and the pairing of its frames with the steps that the displays show.
#pragma once

#include <absl/status/status.h>

#include <map>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "core/timing/proof.h"
#include "server/rig/node_streams.h"

namespace glasswing {

class Recording {
 public:
  // Starts the camera, which stops on destruction. `links` is borrowed. `request_id`: CaptureRequest's.
  Recording(const RigLinks& links, double exposure_ms, const std::string& request_id);
  // Returns when the camera is running as requested, or an error (CaptureStream::wait_running).
  absl::Status wait_running(std::stop_token stop) { return camera_.wait_running(stop); }
  double exposure_ms() const { return camera_.exposure_ms(); }

  // Forgets which steps were shown and matched in the previous showing, whose frames may still arrive.
  void begin_showing();
  // All monitors have shown the window's step. Returns false if it was also shown in an earlier showing.
  bool add_window(const StableWindow& window);
  // Takes the frames that have arrived, and returns their count. Frames whose exposure or size differs from
  // the request are counted but never matched.
  int take_frames();
  // Why the camera's stream has ended; none while it is running.
  std::optional<absl::Status> end() const { return camera_.inbox.end(); }
  // The pairs found since the last call.
  std::vector<FrameMatcher::Match> take_matches();
  // A matched frame as the camera reported it. Null: too many frames have arrived since.
  const v1::FrameTaken* taken(const FrameMatcher::Match& match) const;
  // End of the newest frame; none before the first.
  std::optional<nanoseconds> frames_seen_until() const { return matcher_.frames_seen_until(); }

  bool was_shown(int step) const { return shown_.contains(step); }
  bool was_shown_now(int step) const { return shown_now_.contains(step); }
  // A frame's exposure overlapped the time in which the step was certainly on screen in this showing.
  bool has_frame_of(int step) const;
  bool was_matched_now(int step) const { return matched_now_.contains(step); }
  // When the step was on screen in this showing.
  const StableWindow& window_of(int step) const { return shown_now_.at(step); }
  // The last frame whose exposure lay in the time in which the step's id patch was certainly on screen;
  // `first`, one of them, if there is no other.
  std::int64_t last_of_patch(int step, std::int64_t first) const;
  // In rig time, increasing.
  std::vector<FrameTime> recent_frames() const;
  // Stops the camera. The newest frames stay in its node's ring.
  void stop_camera() { camera_.cancel(); }

 private:
  const RigLinks& links_;
  CaptureStream camera_;
  FrameMatcher matcher_;
  std::map<std::int64_t, v1::FrameTaken> recent_;  // by sequence
  std::set<int> shown_;                            // steps that all monitors have shown
  std::map<int, StableWindow> shown_now_;          // of the current showing, by step
  std::set<int> matched_now_;                      // of the current showing
};

}  // namespace glasswing
