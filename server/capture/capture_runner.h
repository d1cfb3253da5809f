// The server's captures: which session drives the rig, and its outcome.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/capture/capture.h"
#include "server/capture/capture_check.h"
#include "server/rig/calibration_store.h"
#include "server/rig/node_registry.h"
#include "server/rig/rig_lock.h"
#include "server/sessions/session_store.h"
#include "server/sessions/step_log.h"
#include "server/storage/image_files.h"

namespace glasswing {

// Thread-safe. Errors are those listed in session_service.proto.
class CaptureRunner {
 public:
  enum class Wish { kNone, kPause, kCancel };

  // `next_round` is called after each round of an adaptive session (AdaptiveRounds::grow).
  // `progressed` is called under an Edit with each new record of a session that is being captured, and when
  // its capture has ended; `captured` with the name of each session whose last step is proven, also under
  // mutex_.
  CaptureRunner(SessionStore& sessions, const NodeRegistry& nodes, RigLock& rig_lock,
                const CalibrationStore& calibrations, ImageFiles& images, NextRound next_round,
                std::function<void(const v1::Session&)> progressed,
                std::function<void(const std::string& session)> captured)
      : sessions_(sessions),
        nodes_(nodes),
        rig_lock_(rig_lock),
        calibrations_(calibrations),
        images_(images),
        next_round_(std::move(next_round)),
        progressed_(std::move(progressed)),
        captured_(std::move(captured)) {}
  ~CaptureRunner();  // pauses a running capture

  // Sessions left capturing by an earlier server are paused.
  void take_up(SessionStore::Edit& edit, std::span<const v1::Session> sessions);

  absl::StatusOr<v1::EstimateSessionResponse> estimate(const v1::EstimateSessionRequest& request);
  // Of a plan with several cameras a session with a view for each (server/sessions/views).
  absl::StatusOr<v1::Session> create(const v1::CreateSessionRequest& request, const Caller& caller);
  // Continues a paused or failed capture (session_state.h); of a session with views those that rest in
  // theirs, together.
  absl::StatusOr<v1::Session> resume(SessionStore::Edit& edit, v1::Session session,
                                     const v1::ResumeSessionRequest& request, const Caller& caller);
  // Cancels a capture that is paused or was not started.
  absl::StatusOr<v1::Session> cancel(SessionStore::Edit& edit, v1::Session session);
  // Stops the running capture of the session and waits until it comes to rest. Call without an Edit.
  // FAILED_PRECONDITION: another client holds the rig.
  absl::StatusOr<v1::Session> stop(const std::string& session, Wish wish, const Caller& caller);

  // The events of the session's steps from `first` on.
  absl::StatusOr<std::vector<v1::StepEvent>> steps(const std::string& session, size_t first);

  void forget(const v1::Session& session);

 private:
  absl::Status check_new_name(const std::string& name);
  // The sessions that the request makes: one, or the views of one.
  absl::StatusOr<std::vector<v1::Session>> sessions_of(const v1::CreateSessionRequest& request,
                                                       const CheckedCapture& checked, const Caller& caller);
  absl::Status check_images(const std::vector<Step>& steps) const;
  // The axes, and the sessions whose empty stage is taken.
  absl::Status check_pose(const std::vector<v1::Session>& sessions) const;
  std::string chosen_name(const std::string& created);
  absl::StatusOr<RigLock::Drive> drive_for(const std::string& session, const Caller& caller);
  // Starts the capture of `name`.
  void start(SessionStore::Edit& edit, const std::string& name, std::vector<v1::Session> sessions,
             RigLock::Drive drive);
  void capture_until_done(const std::string& name, std::vector<v1::Session> sessions,
                          std::optional<bool> object_confirmed, std::stop_token stop);
  // Stores and shows what a capture reports of a session, which it then is.
  void note_progress(const v1::Session& progress, v1::Session& session, nanoseconds& saved_at);
  void say_waiting(const std::string& reason, v1::Session& session);
  // The session as clients see it: while it is being stopped its reason says so.
  v1::Session as_it_ends(v1::Session session);
  void note_outcomes(std::vector<v1::Session> sessions, const std::vector<CaptureOutcome>& outcomes);
  void note_outcome(SessionStore::Edit& edit, v1::Session session, const CaptureOutcome& outcome);

  SessionStore& sessions_;
  const NodeRegistry& nodes_;
  RigLock& rig_lock_;
  const CalibrationStore& calibrations_;
  ImageFiles& images_;
  const NextRound next_round_;
  const std::function<void(const v1::Session&)> progressed_;
  const std::function<void(const std::string&)> captured_;
  StepLog steps_;

  std::mutex mutex_;             // guards all below; taken after an Edit, never before
  std::string capturing_;        // the session that drives the rig; empty: none
  std::set<std::string> views_;  // meanwhile: it, or its views that are being captured
  RigLock::Drive drive_;         // meanwhile
  Wish wish_ = Wish::kNone;      // how the capture shall be stopped
  std::map<std::string, bool>
      operator_asked_;  // by what is captured and waits for a person: to place the object?
  std::jthread thread_;
};

}  // namespace glasswing
