// Shows steps on all displays as one program, and turns the cameras' frames that prove a step into records.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <map>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "server/capture/camera_view.h"
#include "server/capture/recording.h"

namespace glasswing {

class PictureDemand;
class ProgramFeeds;

// A camera that records a showing.
struct Watching {
  // Takes the records of frames proven by time, in the order of their steps; called every few milliseconds
  // while the program plays, often with none, and at the same time as other cameras' judges. Returns false to
  // end the showing for this camera.
  using Judge = std::function<absl::StatusOr<bool>(std::vector<v1::Frame>)>;

  CameraView& view;
  Recording& recording;
  std::set<int> steps;  // that it needs; the others are shown for other cameras
  Judge judge;
  bool is_over = false;       // its judge has ended the showing
  absl::Status failure = {};  // why the camera cannot go on, of one that takes pictures on demand
};

class StepPlayer {
 public:
  // `views` are borrowed; they must be there, with their setup, when steps are shown.
  explicit StepPlayer(const CameraViews& views) : views_(views) {}

  // Measures the offsets of all nodes' clocks. play() repeats this every second.
  absl::Status measure_clocks(int count, const std::stop_token& stop);
  // Shows `steps` once. Returns when the last frame that may belong to them has arrived, or earlier, if all
  // judges or `stop` end the showing. A start that a display refused, because the command arrived too late,
  // is repeated with more time for the command. ABORTED: another program took over the screens. If the
  // cameras take pictures on demand (either all do or none), each step is held until all of them have proven
  // frames of it; Watching.failure: no picture arrives.
  absl::Status play(const std::vector<Step>& steps, std::span<Watching> cameras, std::stop_token stop);

 private:
  // Returns how many monitors will report each step.
  absl::StatusOr<int> load(const std::string& program, const std::vector<Step>& steps, double exposure_ms,
                           std::stop_token stop);
  absl::Status load(DisplayLink& display, const std::string& program, const std::vector<Step>& steps,
                    double exposure_ms, std::stop_token stop);
  // Plays the loaded program. False: the command arrived too late at a display.
  absl::StatusOr<bool> play_loaded(const std::string& program, int monitor_count, std::span<Watching> cameras,
                                   std::stop_token stop);
  // Gives the frames that have arrived to the judges, which run at the same time.
  absl::Status judge(std::span<Watching> cameras) const;
  // Holds one step for each of these until it is proven (a patch-learning step until it has a frame), until
  // pictures arrive that do not prove it, or until the judge ends the camera's showing.
  absl::Status play_held(const Step& step, std::span<Watching* const> cameras, std::stop_token stop);
  // When all monitors show it: a window without end. None: stopped.
  absl::StatusOr<std::optional<StableWindow>> wait_shown(ProgramFeeds& feeds,
                                                         std::span<Watching* const> cameras,
                                                         std::stop_token stop);
  // Judges the pictures that have arrived of a held step. True: the camera needs no more in this showing.
  absl::StatusOr<bool> judge_held(const Step& step, const StableWindow& shown, PictureDemand& demand,
                                  std::stop_token stop) const;
  absl::StatusOr<std::vector<v1::Frame>> records_of(const std::vector<FrameMatcher::Match>& matches,
                                                    const Watching& camera) const;
  std::string next_program();
  // Of a camera that takes part: all share the displays.
  RigLinks& links() const;
  int hold_refreshes() const { return hold_refreshes_of(views_.front()->progress.session().plan()); }

  const CameraViews& views_;
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
