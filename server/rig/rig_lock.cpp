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

bool RigLock::is_held() const {
  if (!reservation_) return false;
  return reservation_->count > 0 ||
         std::chrono::steady_clock::now() < reservation_->abandoned + reservation_->linger;
}

absl::Status RigLock::check_locked(const Caller& caller) const {
  if (caller.hold == (is_held() ? reservation_->token : "")) return absl::OkStatus();
  if (!caller.hold.empty()) {
    return absl::FailedPreconditionError(
        "the hold of this call has ended, and another client may have the rig: glasswing hold");
  }
  const v1::RigHolder& holder = reservation_->holder;
  return absl::FailedPreconditionError(fmt::format("the rig is held for \"{}\", {}; wait until it is freed",
                                                   holder.what(), origin(holder, "taken")));
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

absl::StatusOr<RigLock::Hold> RigLock::hold(const Caller& caller, const std::string& reason,
                                            std::chrono::milliseconds linger) {
  const std::lock_guard lock(mutex_);
  if (is_held() && reservation_->token == caller.hold) {
    ++reservation_->count;
    reservation_->linger = linger;
    return Hold(this, Leave{reservation_->token});
  }
  GW_RETURN_IF_ERROR(check_free(caller));
  reservation_ = Reservation{.holder = holder_of(caller, reason), .token = random_token(), .linger = linger};
  return Hold(this, Leave{reservation_->token});
}

absl::Status RigLock::release(const Caller& caller) {
  const std::lock_guard lock(mutex_);
  if (caller.hold.empty())
    return absl::FailedPreconditionError(
        "this call does not belong to a hold: only the holder of the rig can release it");
  GW_RETURN_IF_ERROR(check_locked(caller));
  reservation_.reset();
  return absl::OkStatus();
}

std::optional<v1::RigHolder> RigLock::holder() const {
  const std::lock_guard lock(mutex_);
  if (is_held()) {
    v1::RigHolder holder = reservation_->holder;
    if (driving_) holder.set_what(fmt::format("{} ({})", holder.what(), driving_->holder.what()));
    return holder;
  }
  if (driving_) return driving_->holder;
  return std::nullopt;
}

void RigLock::Stop::operator()(RigLock* lock) const {
  const std::lock_guard guard(lock->mutex_);
  lock->driving_.reset();
}

void RigLock::Leave::operator()(RigLock* lock) const {
  const std::lock_guard guard(lock->mutex_);
  std::optional<Reservation>& hold = lock->reservation_;
  if (!hold || hold->token != token) return;  // released
  if (--hold->count == 0) hold->abandoned = std::chrono::steady_clock::now();
}

}  // namespace glasswing
