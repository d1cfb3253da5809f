#include "core/security/call_shares.h"

#include <fmt/format.h>

namespace glasswing {

CallShares& call_shares() {
  static CallShares shares(1024);
  return shares;
}

CallShares::Kind CallShares::kind_of(Roles roles) {
  if ((roles & (kNodes | only(Role::kServer))) != 0) return Kind::kProgram;
  return (roles & (only(Role::kOperator) | only(Role::kConsole))) != 0 ? Kind::kOperator : Kind::kViewer;
}

void CallShares::set_max_calls(int max_calls) {
  const std::lock_guard lock(mutex_);
  max_calls_ = max_calls;
}

void CallShares::forget(Time now) {
  for (auto at = callers_.begin(); at != callers_.end();) {
    std::deque<Time>& admitted = at->second.admitted;
    while (!admitted.empty() && now - admitted.front() >= kBegins) admitted.pop_front();
    at = at->second.count() == 0 ? callers_.erase(at) : std::next(at);
  }
}

int CallShares::count(Kind kind) const {
  int count = 0;
  for (const auto& [name, calls] : callers_) count += calls.kind == kind ? calls.count() : 0;
  return count;
}

absl::Status CallShares::admit(const std::string& caller, Roles roles, Time now) {
  const std::lock_guard lock(mutex_);
  forget(now);
  const Kind kind = kind_of(roles);
  const int viewers = count(Kind::kViewer), people = viewers + count(Kind::kOperator);
  int own = max_calls_ / 2;
  std::string others;
  if (kind == Kind::kViewer) {
    own = max_calls_ / 16;
    if (viewers >= max_calls_ / 4) others = fmt::format("viewers have {}", viewers);
  }
  if (kind == Kind::kOperator) own = max_calls_ / 8;
  if (kind != Kind::kProgram && people >= max_calls_ / 2) others = fmt::format("people have {}", people);
  const auto known = callers_.find(caller);
  const int has = known == callers_.end() ? 0 : known->second.count();
  if (has >= own) {
    return absl::ResourceExhaustedError(
        fmt::format("\"{}\" has {} calls running, the maximum for one caller; end some first", caller, has));
  }
  if (!others.empty())
    return absl::ResourceExhaustedError(others + " calls running, the maximum; try again later");
  Calls& calls = callers_[caller];
  calls.kind = kind;
  calls.admitted.push_back(now);
  return absl::OkStatus();
}

void CallShares::begin(const std::string& caller, Roles roles) {
  const std::lock_guard lock(mutex_);
  Calls& calls = callers_[caller];
  calls.kind = kind_of(roles);
  if (!calls.admitted.empty()) calls.admitted.pop_front();
  ++calls.running;
}

void CallShares::end(const std::string& caller) {
  const std::lock_guard lock(mutex_);
  const auto known = callers_.find(caller);
  if (known != callers_.end() && --known->second.running == 0 && known->second.admitted.empty())
    callers_.erase(known);
}

}  // namespace glasswing
