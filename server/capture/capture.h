// One capture, from the first step without proof to the sealed archive. Loads programs into the displays,
// lets the camera run, listens to both, proves, and has the camera keep what is proven. No RPC stands between
// one step and the next.
//
// A video (core/pattern/plan) runs once: its steps that get no proof are lost. One that broke off, for
// whatever reason, is not gone on with: what was recorded stays, and the rest is lost too.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "core/pattern/plan.h"
#include "core/pattern/stimulus_kind.h"
#include "glasswing/v1/archive_service.grpc.pb.h"
#include "glasswing/v1/session_service.pb.h"
#include "glasswing/v1/stage_service.grpc.pb.h"
#include "server/rig/node_streams.h"
#include "server/sessions/step_log.h"

namespace glasswing {

// Of those that teach the camera where an id patch is.
inline bool is_lesson(const Step& step) {
  return kind_of(step.stimulus) == StimulusKind::kPatch;
}

// A lesson shows its own, and a calibration's exposures suit none.
inline bool shows_id(const Step& step) {
  return !is_lesson(step) && !step.stimulus.codes();
}

struct CaptureOutcome {
  enum class Kind {
    kCaptured,
    kStopped,        // asked to
    kNodeLost,       // a node went away; going on later loses nothing
    kNoRoom,         // the camera node has no room for frames; going on later loses nothing
    kNeedsOperator,  // a person has to move the object, then resume
    kFailed,
  };
  Kind kind = Kind::kFailed;
  std::string reason;
};

class Capture {
 public:
  // `images` holds what UploadImage stored. `object_confirmed`: a person has said that the object is (not) on
  // the stage. `log` hears of each step. `report` is called with the counts brought up to date, from the
  // thread that calls run().
  Capture(const NodeRegistry& rig, const CalibrationStore& calibrations, std::filesystem::path images,
          v1::Session session, std::optional<bool> object_confirmed, StepLog& log,
          std::function<void(const v1::Session&)> report);
  ~Capture();

  CaptureOutcome run(std::stop_token stop);

 private:
  struct Group {
    bool object;
    double exposure_ms;
    std::vector<Step> steps;
  };
  // The running camera, and which of its frames prove which steps.
  struct Recording {
    Recording(const NodeLink& node, v1::CameraService::Stub& stub, double exposure_ms)
        : camera(node, stub, exposure_ms) {}

    CameraStream camera;
    FrameMatcher matcher;
    std::set<int> shown;                      // steps, on all monitors
    std::set<int> shown_now, matched;         // likewise, since the program began; those that a frame lies in
    nanoseconds clocks_at = monotonic_now();  // last compared; showings may be shorter than the pause between
    std::map<std::int64_t, v1::FrameTaken> recent;  // by sequence
    // Steps that teach where the id patches are and wait with the camera for others; matches of other steps
    // wait here until all are learned.
    std::set<int> lessons;
    std::vector<FrameMatcher::Match> waiting;
    struct Unseen {
      int count = 0;
      bool dark = false;
    };
    std::map<std::string, Unseen> unseen;  // by monitor: how often its lessons taught nothing
    int vain_lessons = 0;                  // showings that ended there
  };

  absl::Status find_rig();
  absl::Status open_archive();
  absl::Status check_room();
  // Of a call to what stores frames.
  absl::Status stored(const grpc::Status& status);
  absl::Status send_images();
  // False: a person has to move it.
  absl::StatusOr<bool> move_object(bool present);
  absl::Status take(const Group& group, std::stop_token stop);
  absl::Status take_video(const Group& group, const std::vector<Step>& video, Recording& frames,
                          std::stop_token stop);
  // `what` has no proof; says what may help.
  absl::Status unproven(const std::string& what, const Group& group, int step_count, int refused) const;
  void note_unproven(const std::vector<Step>& steps);
  absl::Status play(const std::vector<Step>& steps, Recording& frames, std::stop_token stop);
  double seconds() const;  // of showing and recording, in all
  void tell(int step, v1::StepOutcome outcome, const std::string& why = "");
  void tell_retaken(const std::vector<Step>& steps, const Recording& frames);
  absl::StatusOr<int> load(const std::string& program, const std::vector<Step>& steps);
  void take_frames(Recording& frames);
  // False: a lesson was missed or taught nothing, and what follows cannot be judged.
  absl::StatusOr<bool> judge(const std::vector<FrameMatcher::Match>& matches, std::set<int>& lessons_due,
                             Recording& frames);
  absl::Status keep_lessons(const std::vector<FrameMatcher::Match>& lessons, Recording& frames);
  absl::StatusOr<v1::KeepFramesResponse> keep(const std::vector<FrameMatcher::Match>& matches,
                                              Recording& frames);
  std::vector<std::string> patches_given_up(const Recording& frames) const;
  void note_proven(const v1::Frame& frame);
  bool runs_once(const Step& step) const;  // a frame of the video
  std::vector<int> video_steps() const;    // in order
  bool video_has_run() const;              // or some of it
  void note_lost(bool broken_off);
  void warn(const std::string& what);
  absl::Status seal();

  const NodeRegistry& rig_;
  const CalibrationStore& calibrations_;
  const std::filesystem::path images_;
  v1::Session session_;
  const std::optional<bool> object_confirmed_;
  StepLog& log_;
  const std::function<void(const v1::Session&)> report_;

  RigLinks links_;
  std::unique_ptr<v1::ArchiveService::Stub> archive_stub_;
  std::unique_ptr<v1::StageService::Stub> stage_stub_;
  std::vector<v1::Monitor> monitors_;
  v1::CaptureManifest embedded_;  // the archive's header
  std::vector<Step> steps_;
  std::set<int> proven_;
  double seconds_before_ = 0.0;             // of showing, when the group began that is taken now
  std::optional<nanoseconds> group_began_;  // none: no group is taken
  bool no_room_ = false;
  int program_number_ = 0;
  nanoseconds start_lead_ = std::chrono::milliseconds(120);  // from a program's command to its first step
  std::uint32_t showings_ = 0;                               // so far, of any step
  std::map<int, std::uint32_t> patch_ids_;                   // by step, of its last showing
  std::set<std::string> unseen_patches_;                     // monitors whose steps do without
};

}  // namespace glasswing
