// Exclusive use of the rig. One capture or measurement drives it at a time. A hold also reserves it for one
// client between these: calls without the hold's token are refused. Several calls may share a hold.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// The client of a call, by its metadata (session_service.proto).
struct Caller {
  std::string client;  // "anna@lab3"; empty: not given
  std::string hold;    // token of the hold that the call belongs to; empty: none
};

// Thread-safe. Must outlive the drives and holds that it returns.
class RigLock {
 public:
  struct Stop {
    void operator()(RigLock* lock) const;
  };
  struct Leave {
    std::string token;  // calls that carry it belong to the hold
    void operator()(RigLock* lock) const;
  };
  using Drive = std::unique_ptr<RigLock, Stop>;
  using Hold = std::unique_ptr<RigLock, Leave>;

  // Occupies the rig until the drive is destroyed. `what`: "session vase", "calibrate sync". `how_to_end`:
  // the command that frees the rig; empty: others can only wait. FAILED_PRECONDITION: names the rig's holder,
  // or says that the caller's hold has ended.
  absl::StatusOr<Drive> drive(const Caller& caller, const std::string& what,
                              const std::string& how_to_end = "");
  // Reserves the rig for the caller, or joins the caller's own hold; `reason` is then ignored. The hold ends
  // with release(), or `linger` after the last of its values is destroyed unless the caller rejoins it.
  // Errors as drive()'s.
  absl::StatusOr<Hold> hold(const Caller& caller, const std::string& reason,
                            std::chrono::milliseconds linger = {});
  // Ends the caller's hold. FAILED_PRECONDITION: the caller has no hold.
  absl::Status release(const Caller& caller);

  // FAILED_PRECONDITION: another client holds the rig.
  absl::Status check(const Caller& caller) const;

  // Empty: the rig is free. For a hold, `what` is its reason, and what drives the rig: "series (session
  // vase)".
  std::optional<v1::RigHolder> holder() const;

 private:
  struct Use {
    v1::RigHolder holder;
    std::string how_to_end;
  };
  struct Reservation {
    v1::RigHolder holder;
    std::string token;
    std::chrono::milliseconds linger;
    int count = 1;                                         // of the Hold values
    std::chrono::steady_clock::time_point abandoned = {};  // if count is 0
  };
  bool is_held() const;
  absl::Status check_locked(const Caller& caller) const;
  absl::Status check_free(const Caller& caller) const;

  mutable std::mutex mutex_;
  std::optional<Use> driving_;              // guarded by mutex_
  std::optional<Reservation> reservation_;  // guarded by mutex_; may have ended: is_held()
};

}  // namespace glasswing
