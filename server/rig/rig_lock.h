// Who may drive the rig. One capture or measurement drives it at a time; a hold keeps it for one client
// between these too: what comes without the hold's token is refused meanwhile.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "glasswing/v1/node_service.pb.h"

namespace glasswing {

// Who makes a call, by its metadata (session_service.proto).
struct Caller {
  std::string client;  // "anna@lab3"; empty: did not say
  std::string hold;    // token of the hold under which it comes; empty: none
};

// Thread-safe; outlives what it hands out.
class RigLock {
 public:
  struct Stop {
    void operator()(RigLock* lock) const;
  };
  struct Free {
    void operator()(RigLock* lock) const;
  };
  using Drive = std::unique_ptr<RigLock, Stop>;
  using Hold = std::unique_ptr<RigLock, Free>;

  // The rig, until the drive is gone. `what`: "session vase", "calibrate sync"; `how_to_end`: what others can
  // do about it, empty if they can but wait. FAILED_PRECONDITION names who has it, or says that the caller's
  // hold has ended.
  absl::StatusOr<Drive> drive(const Caller& caller, const std::string& what,
                              const std::string& how_to_end = "");
  // For the caller alone, until the hold is gone; what drives the rig then may go on. Errors as drive()'s.
  absl::StatusOr<Hold> hold(const Caller& caller, const std::string& reason);
  // Of the hold. Calls that bring it come under it.
  std::string token() const;

  // FAILED_PRECONDITION: another client's hold keeps the caller from changing what the rig does.
  absl::Status check(const Caller& caller) const;

  std::optional<v1::RigHolder> holder() const;  // none: the rig is free

 private:
  struct Use {
    v1::RigHolder holder;
    std::string how_to_end;
  };
  absl::Status check_locked(const Caller& caller) const;
  absl::Status check_free(const Caller& caller) const;

  mutable std::mutex mutex_;
  std::optional<Use> driving_;            // guarded by mutex_
  std::optional<v1::RigHolder> holding_;  // guarded by mutex_
  std::string token_;                     // guarded by mutex_; empty: no hold
};

}  // namespace glasswing
