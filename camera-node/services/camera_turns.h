// Access to the camera: one call at a time.
#pragma once

#include <absl/status/status.h>

#include <atomic>
#include <condition_variable>
#include <functional>
#include <list>
#include <mutex>
#include <string>

namespace glasswing {

// A call that runs the camera until it ends. It must not move from take() to the end of its turn.
struct CameraCall {
  std::string id = {};  // a call takes the camera over from earlier ones of its id; empty: from none
  double exposure_ms = 0.0;
  bool triggered = false;
  std::function<bool()> is_gone = {};  // its caller has gone; any thread may ask
  bool started = false;                // it got the camera running, at its exposure
  std::atomic<bool> replaced = false;  // a later call of its id has come: end the turn
};

// Thread-safe.
class CameraTurns {
 public:
  // Returns when the call has the camera. A call with the same id is replaced, and a call whose caller has
  // gone is waited for, however long they take to end. FAILED_PRECONDITION: a call of another client still
  // has the camera after waiting for a second. ABORTED: `call` was replaced while it waited. CANCELLED: its
  // caller has gone.
  absl::Status take(CameraCall& call);
  // False: another call has the camera, or waits for it.
  bool try_take(CameraCall& call);
  // A call other than the camera's current one waits for it.
  bool is_wanted() const;

  // Ends the turn while the camera is running. True: the call that replaced `call` continues with the running
  // camera. False: stop the camera, then end().
  bool hand_over(const CameraCall& call);
  // Ends the turn after the camera was stopped.
  void end(const CameraCall& call);

 private:
  absl::Status wait(CameraCall& call, std::unique_lock<std::mutex>& lock);
  mutable std::mutex mutex_;
  std::condition_variable ended_;
  CameraCall* holder_ = nullptr;    // guarded by mutex_
  std::list<CameraCall*> waiting_;  // in their order; guarded by mutex_
};

}  // namespace glasswing
