// Decides how one group of steps (one stage, one exposure) learns where the camera sees each monitor's id
// patch.
//
// A patch-learning step shows a known id. Its frame goes to the camera node (CameraService.LearnPatches) with
// the last one that must also show the id. The node holds both until the set of a monitor is complete. Frames
// of other steps are queued here until every learning step is proven, because their pixels cannot be judged
// earlier. A monitor whose patch stays unseen is given up: its steps are then proven by time alone. Pixels
// that contradict the reported times, or a camera in whose frames nothing changes at all, fail the capture.
//
// This class makes no calls. For each batch of frames that time alone has proven: take_learning_frames(),
// send those, note_learned() with the answer, then take_ready_frames().
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "glasswing/v1/camera_service.pb.h"

namespace glasswing {

inline bool is_patch_learning_step(const Step& step) {
  return kind_of(step.stimulus) == StimulusKind::kPatch;
}

// Patch-learning steps show their own ids, and a calibration's exposures are unsuitable for patches.
inline bool shows_id(const Step& step) {
  return !is_patch_learning_step(step) && !step.stimulus.codes();
}

class PatchLearning {
 public:
  static constexpr int kMaxAttempts = 8;      // at a patch that is there but cannot be read
  static constexpr int kMaxDarkAttempts = 2;  // at one that the camera does not seem to look at
  // Frames of other steps that a showing collects after a dark patch, to see whether anything changes.
  static constexpr size_t kOthers = 8;

  // `given_up`: monitors whose steps do not use a patch. It is borrowed, because it outlives the group.
  // `others`: instead of kOthers.
  explicit PatchLearning(std::set<std::string>& given_up, size_t others = kOthers)
      : given_up_(given_up), others_(others) {}

  // Starts a showing and drops the queue of the previous one. Returns the steps to show: all of `pending`
  // except those whose frames the camera node holds.
  std::vector<Step> begin_showing(const std::vector<Step>& pending);

  // Queues the frames. Removes and returns those of patch-learning steps whose patch has left the screen.
  std::vector<v1::Frame> take_learning_frames(std::vector<v1::Frame> frames,
                                              const std::function<bool(int step)>& has_left);
  // Monitors to name in LearnPatchesRequest.accept_unseen_patches: those already given up, and those that
  // will be if the next set does not show their patch either.
  std::vector<std::string> accepted_unseen() const;
  // Takes the camera node's answer, and returns a warning for each monitor that has just been given up.
  std::vector<std::string> note_learned(const v1::LearnPatchesResponse& response);
  // Removes and returns the queued frames if all learning steps are proven, and an empty list if none is
  // queued. None: frames are queued although a learning step is not proven. Since steps are proven in order,
  // it was missed, and this showing has to be repeated.
  std::optional<std::vector<v1::Frame>> take_ready_frames();

  // The camera node holds the step's frame until the rest of its set arrives.
  bool is_held(int step) const { return held_.contains(step); }
  // Showings with a patch that was not seen. These do not count as retries.
  int unseen_showings() const { return unseen_showings_; }
  // A patch that contradicted the reported times, stayed dark while nothing else changed, or was not seen by
  // a camera that needs it, in so many attempts that the capture fails; null: none.
  const v1::UnseenPatch* hopeless() const;

 private:
  struct Unseen {
    int count = 0;  // since a contradiction
    int contradictions = 0, frozen = 0;
    v1::UnseenPatch last;
  };

  std::set<std::string>& given_up_;
  const size_t others_;
  std::map<int, std::string> due_;   // learning steps of this showing that are not proven, with their monitor
  std::map<int, std::string> held_;  // steps whose frames the camera node holds, with their monitor
  std::vector<v1::Frame> learning_;  // of learning steps whose patch may still be on screen
  std::vector<v1::Frame> queue_;     // of other steps
  std::map<std::string, Unseen> unseen_;  // by monitor: how often a set did not show its patch
  int unseen_showings_ = 0;
};

}  // namespace glasswing
