#include "console/http/login_limit.h"

#include <algorithm>

namespace glasswing {

void LoginLimit::forget_old(Time now) {
  std::erase_if(refused_, [now](const auto& each) { return now - each.second.first >= kWindow; });
}

bool LoginLimit::allows(const std::string& address, Time now) {
  const std::lock_guard lock(mutex_);
  const auto found = refused_.find(address);
  return found == refused_.end() || found->second.count < kMaxRefused || now - found->second.first >= kWindow;
}

void LoginLimit::note_refused(const std::string& address, Time now) {
  const std::lock_guard lock(mutex_);
  forget_old(now);
  if (refused_.size() >= kMaxAddresses && !refused_.contains(address)) {
    refused_.erase(std::ranges::min_element(
        refused_, [](const auto& a, const auto& b) { return a.second.first < b.second.first; }));
  }
  Refused& refused = refused_.try_emplace(address, Refused{.first = now}).first->second;
  ++refused.count;
}

}  // namespace glasswing
