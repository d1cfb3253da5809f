// Leases that cannot be forged: job, tile and attempt are small numbers, so a solver could name those of
// others.
//
//   secret = HMAC-SHA256(key, "job tile attempt session\ncaller")
//
// `caller` is the certificate of the solver to which the tile was handed out; the key is the job store's.
#pragma once

#include <absl/status/status.h>

#include <mutex>
#include <string>

#include "glasswing/v1/work_service.pb.h"
#include "server/jobs/job_store.h"

namespace glasswing {

// Thread-safe. UNAVAILABLE: the job store does not answer.
class LeaseSeal {
 public:
  explicit LeaseSeal(JobStore& jobs) : jobs_(jobs) {}  // borrowed
  absl::Status seal(const std::string& caller, v1::TileLease& lease);
  // ABORTED: the lease was not handed out to this caller.
  absl::Status check(const std::string& caller, const v1::TileLease& lease);

 private:
  absl::StatusOr<std::string> secret_of(const std::string& caller, const v1::TileLease& lease);

  JobStore& jobs_;
  std::mutex mutex_;
  std::string key_;  // empty: not read yet; guarded by mutex_
};

}  // namespace glasswing
