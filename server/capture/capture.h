// One capture, from the first step without a proof to the sealed archive: connects to the rig, opens the
// archive, captures the groups of steps in order (GroupCapture), and seals.
//
// The rest is split by duty: StepPlayer shows steps, Recording pairs frames with them, PatchLearning decides
// what can be judged from pixels, CaptureArchive makes the camera node store proven frames, VideoCapture
// handles the steps that run only once. No RPC is made between one step and the next.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/capture/capture_archive.h"
#include "server/capture/capture_progress.h"
#include "server/capture/capture_setup.h"
#include "server/capture/rig_watch.h"
#include "server/capture/step_player.h"
#include "server/capture/video_capture.h"
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

// For an adaptive session whose steps are all stored: the session with one more round in its plan, stored
// durably, or with the same plan if there is to be no further round.
using NextRound = std::function<absl::StatusOr<v1::Session>(const v1::Session&, std::stop_token)>;

class Capture {
 public:
  // `object_confirmed`: a person has confirmed that the object is on the stage, or off it. `log` records the
  // outcome of each step. `report` is called with the updated session, from the thread that calls run().
  Capture(const NodeRegistry& rig, const CalibrationStore& calibrations, const ImageFiles& images,
          v1::Session session, std::optional<bool> object_confirmed, StepLog& log,
          std::function<void(const v1::Session&)> report, NextRound next_round);
  ~Capture();

  CaptureOutcome run(std::stop_token stop);

 private:
  struct Group {
    bool object;
    double exposure_ms;
    std::vector<Step> steps;
  };

  absl::Status capture(std::stop_token stop);
  // Captures all pending steps. False: a person has to move the object.
  absl::StatusOr<bool> capture_pending(std::optional<bool>& object_at, std::stop_token stop);
  // False: there are to be no further images.
  absl::StatusOr<bool> add_round(std::stop_token stop);
  CaptureOutcome outcome_of(const absl::Status& status, bool stopped) const;
  absl::Status find_rig(std::stop_token stop);
  absl::Status open_archive(std::stop_token stop);
  // Checks for all remaining steps, so that a session that waits for space does not resume for a few frames
  // each time.
  absl::Status check_room(std::stop_token stop);
  absl::Status send_images(std::stop_token stop);
  // The steps to capture, split where the stage or the exposure changes.
  std::vector<Group> pending_groups() const;
  bool is_pending(const Step& step, bool video_has_run) const;
  // `at`: on the stage or off it; none: unknown. False: a person has to move it.
  absl::StatusOr<bool> move_object(std::optional<bool> at, bool present, std::stop_token stop);
  // Moves the stage's axes to the session's pose, unless this capture has.
  absl::Status place_object(std::stop_token stop);
  absl::Status capture_group(const Group& group, std::stop_token stop);

  const NodeRegistry& rig_;
  const CalibrationStore& calibrations_;
  const ImageFiles& images_;
  const std::optional<bool> object_confirmed_;
  const NextRound next_round_;

  CaptureSetup setup_;
  CaptureProgress progress_;
  VideoCapture video_;
  StepPlayer player_;
  RigWatch watch_;
  std::optional<CaptureArchive> archive_;   // once the rig is found
  std::set<std::string> patches_given_up_;  // monitors whose steps are proven by time alone
  bool object_placed_ = false;              // in the session's pose
  std::optional<bool> object_wanted_;  // on the stage or off it, by a person; none: nobody has to move it
};

}  // namespace glasswing
