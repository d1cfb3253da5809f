#include "server/rig/rig_lock.h"

#include <fmt/format.h>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/time.h"

namespace glasswing {
namespace {

v1::RigHolder holder_of(const Caller& caller, const std::string& what) {
  v1::RigHolder holder;
  holder.set_client(caller.client);
  holder.set_what(what);
  holder.set_since(utc_now_rfc3339());
  return holder;
}

// "started by anna@lab3 at 14:03:12Z"
std::string origin(const v1::RigHolder& holder, const char* verb) {
  return fmt::format("{}{} at {}", verb, holder.client().empty() ? "" : " by " + holder.client(),
                     holder.since().substr(holder.since().find('T') + 1));
}

}  // namespace

absl::Status RigLock::check_locked(const Caller& caller) const {
  if (caller.hold != token_ && !caller.hold.empty()) {
    return absl::FailedPreconditionError(
        "the hold that this call belongs to has ended, and another client may have the rig: glasswing hold");
  }
  if (caller.hold == token_) return absl::OkStatus();
  return absl::FailedPreconditionError(fmt::format("the rig is held for \"{}\", {}; wait until it is freed",
                                                   holding_->what(), origin(*holding_, "taken")));
}

absl::Status RigLock::check_free(const Caller& caller) const {
  GW_RETURN_IF_ERROR(check_locked(caller));
  if (!driving_) return absl::OkStatus();
  const std::string& how = driving_->how_to_end;
  return absl::FailedPreconditionError(
      fmt::format("the rig is held by {}, {}; wait for it{}", driving_->holder.what(),
                  origin(driving_->holder, "started"), how.empty() ? "" : ", or cancel it: " + how));
}

absl::Status RigLock::check(const Caller& caller) const {
  const std::lock_guard lock(mutex_);
  return check_locked(caller);
}

absl::StatusOr<RigLock::Drive> RigLock::drive(const Caller& caller, const std::string& what,
                                              const std::string& how_to_end) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(check_free(caller));
  driving_ = Use{.holder = holder_of(caller, what), .how_to_end = how_to_end};
  return Drive(this);
}

absl::StatusOr<RigLock::Hold> RigLock::hold(const Caller& caller, const std::string& reason) {
  const std::lock_guard lock(mutex_);
  GW_RETURN_IF_ERROR(check_free(caller));
  if (holding_) return absl::FailedPreconditionError("the rig is held under this token already");
  holding_ = holder_of(caller, reason);
  token_ = random_token();
  return Hold(this);
}

std::string RigLock::token() const {
  const std::lock_guard lock(mutex_);
  return token_;
}

std::optional<v1::RigHolder> RigLock::holder() const {
  const std::lock_guard lock(mutex_);
  if (holding_) return holding_;
  if (driving_) return driving_->holder;
  return std::nullopt;
}

void RigLock::Stop::operator()(RigLock* lock) const {
  const std::lock_guard guard(lock->mutex_);
  lock->driving_.reset();
}

void RigLock::Free::operator()(RigLock* lock) const {
  const std::lock_guard guard(lock->mutex_);
  lock->holding_.reset();
  lock->token_.clear();
}

}  // namespace glasswing
