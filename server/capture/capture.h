// One capture, from the first step without a proof to the sealed archives: connects to the rig, opens each
// camera's archive, shows the groups of steps in order, and seals. Each camera has a session, its own proofs
// and its own retakes: a step is shown until every camera has its frame, and those that have one ignore it.
//
// The rest is split by duty: StepPlayer shows steps; of each camera GroupCapture proves them, Recording pairs
// frames with them, PatchLearning decides what can be judged from pixels, CaptureArchive makes the camera
// node store proven frames, VideoCapture handles the steps that run only once. No RPC is made between one
// step and the next, unless steps are held for cameras that take pictures on demand: these follow the others
// in each group.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/capture/camera_view.h"
#include "server/capture/group_capture.h"
#include "server/capture/step_player.h"
#include "server/sessions/step_log.h"
#include "server/storage/image_files.h"

namespace glasswing {

struct CaptureOutcome {
  enum class Kind {
    kCaptured,
    kStopped,        // as requested
    kNodeLost,       // a node became unreachable; resuming later loses nothing
    kNoRoom,         // the camera node has no disk space for frames; resuming later loses nothing
    kNeedsOperator,  // a person has to move the object, then resume
    kFailed,
  };
  Kind kind = Kind::kFailed;
  std::string reason;
};

// For the sessions of an adaptive capture whose steps are all stored: the sessions with one more round in
// their plan, stored durably, or with the same plan if there is to be no further round.
using NextRound =
    std::function<absl::StatusOr<std::vector<v1::Session>>(std::vector<v1::Session>, std::stop_token)>;

class Capture {
 public:
  using Report = std::function<void(const v1::Session&)>;

  // `name`: of the capture, for people. `sessions`: of one plan, each with its own camera (Plan.camera).
  // `object_confirmed`: a person has confirmed that the object is on the stage, or off it. `log` records the
  // outcome of each step. `report` is called with each updated session; not from several threads at once for
  // the same session.
  Capture(const NodeRegistry& rig, const CalibrationStore& calibrations, const ImageFiles& images,
          std::string name, const std::vector<v1::Session>& sessions, std::optional<bool> object_confirmed,
          StepLog& log, const Report& report, NextRound next_round);
  ~Capture();

  // The outcome of each session, in their order.
  std::vector<CaptureOutcome> run(std::stop_token stop);

 private:
  struct Group {
    bool object;
    double exposure_ms;
    std::vector<Step> steps;  // that any camera needs
  };
  using Cameras = std::vector<std::unique_ptr<GroupCapture>>;
  using Watchers = std::vector<std::pair<GroupCapture*, std::vector<Step>>>;  // with what each needs

  absl::Status capture(std::stop_token stop);
  // Captures all pending steps. False: a person has to move the object.
  absl::StatusOr<bool> capture_pending(std::optional<bool>& object_at, std::stop_token stop);
  // False: there are to be no further images.
  absl::StatusOr<bool> add_round(std::stop_token stop);
  CaptureOutcome outcome_of(const CameraView& view, const absl::Status& status, bool stopped) const;
  absl::Status find_rig(std::stop_token stop);
  absl::Status open_archive(CameraView& view, std::stop_token stop);
  // FAILED_PRECONDITION: the archives were created with different calibrations of the displays.
  absl::Status check_same_displays() const;
  // Checks for all remaining steps, so that a session that waits for space does not resume for a few frames
  // each time.
  absl::Status check_room(CameraView& view, std::stop_token stop);
  absl::Status send_images(std::stop_token stop);
  // The steps to capture, split where the stage or the exposure changes.
  std::vector<Group> pending_groups() const;
  // `at`: on the stage or off it; none: unknown. False: a person has to move it.
  absl::StatusOr<bool> move_object(std::optional<bool> at, bool present, std::stop_token stop);
  // Moves the stage's axes to the session's pose, unless this capture has.
  absl::Status place_object(std::stop_token stop);
  absl::Status capture_group(const Group& group, std::stop_token stop);
  // With the cameras that take pictures on demand, or the others.
  absl::Status capture_group(const Group& group, bool on_demand, std::stop_token stop);
  // Shows the cameras' steps, in the order of `group`, until each is proven.
  absl::Status prove(const Group& group, Cameras& cameras, std::stop_token stop);
  // With repeated pictures between them, unless cameras take pictures on demand.
  std::vector<Step> with_repeats(const std::vector<Step>& steps, bool on_demand);
  // Shows steps once and lets the proven frames be stored. CANCELLED: stopped.
  absl::Status show(const std::vector<Step>& shown, const Watchers& watchers, std::stop_token stop);
  absl::Status take_video(const std::vector<Step>& frames, Cameras& cameras, std::stop_token stop);
  // One camera of several that cannot go on leaves the capture; otherwise `status` is returned.
  absl::Status leave(GroupCapture& camera, const absl::Status& status) const;
  // Of a camera that takes part: those that have left the capture have no further rounds.
  const CameraView& leading_view() const;
  const v1::Session& session() const { return leading_view().progress.session(); }

  const NodeRegistry& rig_;
  const CalibrationStore& calibrations_;
  const ImageFiles& images_;
  const std::string name_;
  const std::optional<bool> object_confirmed_;
  const NextRound next_round_;

  CameraViews views_;
  StepPlayer player_;
  bool object_placed_ = false;         // in the session's pose
  std::optional<bool> object_wanted_;  // on the stage or off it, by a person; none: nobody has to move it
};

}  // namespace glasswing
