// A session as its capture advances: counts, times, warnings, and the outcome of each step. Reports go to the
// step log and to the capture's `report` callback. Used by the capture's thread only.
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "core/pattern/plan.h"
#include "glasswing/v1/session_service.pb.h"
#include "server/sessions/step_log.h"

namespace glasswing {

class CaptureProgress {
 public:
  CaptureProgress(v1::Session session, StepLog& log, std::function<void(const v1::Session&)> report);

  const v1::Session& session() const { return session_; }
  bool is_proven(int step) const { return proven_.contains(step); }
  const std::set<int>& proven() const { return proven_; }
  void report() { report_(session_); }

  // The capture waits for something, given by `why` in the session's reason; empty: it continues.
  void note_waiting(const std::string& why);

  void set_archive_address(const std::string& address) { session_.set_archive_address(address); }
  // Restores the counts from the archive's manifest.
  void resume(const v1::CaptureManifest& manifest, int step_count);

  // Takes the plan, the findings and the warning of an adaptive session.
  void grow(const v1::Session& session, int step_count);

  // Showing and recording time counts only between these two calls.
  void begin_group();
  void end_group() { group_began_.reset(); }
  void update_seconds() { session_.set_capture_seconds(seconds()); }

  void note_frames_taken(int count) { session_.set_frames_taken(session_.frames_taken() + count); }
  // All monitors have shown the step.
  void note_shown(int step, bool again);
  // The camera node has stored `frames`, and rejected others because of their pixels.
  void note_kept(const google::protobuf::RepeatedPtrField<v1::Frame>& frames, int refused);
  void note_retaken(int step, v1::RetakeCause cause);
  void note_unproven(const std::vector<Step>& steps);
  // Replaces the lost frames of the video by these indices into `video_steps`.
  void note_lost(std::span<const int> indices, const std::vector<int>& video_steps);
  void warn(const std::string& warning);
  // Replaces the notes of this capture; those of the session's earlier captures are kept.
  void note_rig_changes(const std::vector<v1::RigChange>& changes);
  // The frames of Session.retaking have been dropped.
  void note_dropped();
  // Total showing and recording time, s.
  double seconds() const;

 private:
  void log_outcome(int step, v1::StepOutcome outcome, const std::string& why = "");
  void count_proven(const v1::Frame& frame);

  v1::Session session_;
  StepLog& log_;
  const std::function<void(const v1::Session&)> report_;
  std::set<int> proven_;
  int rig_changes_before_ = 0;              // of session_.rig_changes()
  double seconds_before_ = 0.0;             // session_.capture_seconds() when the current group began
  std::optional<nanoseconds> group_began_;  // none: no group is being captured
};

}  // namespace glasswing
