// Shows steps on all displays as one program, and turns the camera's frames that prove a step into records.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "server/capture/capture_progress.h"
#include "server/capture/capture_setup.h"
#include "server/capture/recording.h"

namespace glasswing {

class ProgramFeeds;

class StepPlayer {
 public:
  // Takes the records of frames proven by time, in the order of their steps; called every few milliseconds
  // while the program plays, often with none. Returns false to end the showing.
  using Judge = std::function<absl::StatusOr<bool>(std::vector<v1::Frame>)>;

  // Both arguments are borrowed.
  StepPlayer(CaptureSetup& setup, CaptureProgress& progress) : setup_(setup), progress_(progress) {}

  // Measures the offsets of all nodes' clocks. play() repeats this every second.
  absl::Status measure_clocks(int count, const std::stop_token& stop);
  // Shows `steps` once. Returns when the last frame that may belong to them has arrived, or earlier, if
  // `judge` or `stop` ends the showing. A start that a display refused, because the command arrived too late,
  // is repeated with more time for the command. ABORTED: another program took over the screens. If the camera
  // takes pictures on demand, each step is held until its frame is proven; FAILED_PRECONDITION: no picture
  // arrives.
  absl::Status play(const std::vector<Step>& steps, Recording& recording, const Judge& judge,
                    std::stop_token stop);

 private:
  // Returns how many monitors will report each step.
  absl::StatusOr<int> load(const std::string& program, const std::vector<Step>& steps, double exposure_ms,
                           std::stop_token stop);
  absl::Status load(DisplayLink& display, const std::string& program, const std::vector<Step>& steps,
                    double exposure_ms, std::stop_token stop);
  // Plays the loaded program. False: the command arrived too late at a display.
  absl::StatusOr<bool> play_loaded(const std::string& program, int monitor_count, Recording& recording,
                                   const Judge& judge, std::stop_token stop);
  // Holds one step until it is proven (a patch-learning step until it has a frame), or until pictures arrive
  // that do not prove it. False: `judge` or `stop` ends the showing.
  absl::StatusOr<bool> play_held(const Step& step, Recording& recording, const Judge& judge,
                                 std::stop_token stop);
  // When all monitors show it: a window without end. None: stopped.
  absl::StatusOr<std::optional<StableWindow>> wait_shown(ProgramFeeds& feeds, std::stop_token stop);
  absl::StatusOr<std::vector<v1::Frame>> records_of(const std::vector<FrameMatcher::Match>& matches,
                                                    const Recording& recording) const;

  CaptureSetup& setup_;
  CaptureProgress& progress_;
  int program_number_ = 0;
  bool raises_line_ = false;                                 // a display, to expose each picture
  int pictures_ = 0;                                         // of the last program
  nanoseconds start_lead_ = std::chrono::milliseconds(120);  // from a program's command to its first step
  nanoseconds clocks_measured_at_{};
  std::uint32_t showings_ = 0;              // of any step
  std::map<int, std::uint32_t> patch_ids_;  // by step, of its last showing
  std::map<int, Step> loaded_;              // by number, of the last program
};

}  // namespace glasswing
