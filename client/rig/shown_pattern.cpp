#include "client/rig/shown_pattern.h"

#include <absl/strings/match.h>

#include <thread>

namespace glasswing {
namespace {

constexpr std::chrono::hours kLongest(24);
constexpr std::chrono::seconds kSoon(5);  // a server frees the rig
constexpr std::chrono::milliseconds kPoll(20);

}  // namespace

ShownPattern::ShownPattern(const Client& client, const std::string& pattern,
                           const std::vector<std::string>& monitors)
    : server_(client.server_title(), client.server),
      nodes_(client.server_title(), client.server),
      pattern_(pattern) {
  v1::ShowPatternRequest request;
  request.set_pattern(pattern);
  for (const std::string& monitor : monitors) request.add_monitors(monitor);
  set_deadline(context_, kLongest);
  reader_ = server_.stub->ShowPattern(&context_, request);
}

ShownPattern::~ShownPattern() {
  if (ended_) return;
  context_.TryCancel();
  (void)wait_for_end();
  wait_until_free();
}

void ShownPattern::wait_until_free() const {
  const auto deadline = std::chrono::steady_clock::now() + kSoon;
  while (std::chrono::steady_clock::now() < deadline) {
    const absl::StatusOr<v1::ListNodesResponse> rig =
        call(nodes_, &v1::NodeService::Stub::ListNodes, v1::ListNodesRequest());
    // Within a hold: "series (pattern lines)".
    if (!rig.ok() || !rig->has_holder() || !absl::StrContains(rig->holder().what(), "pattern " + pattern_))
      return;
    std::this_thread::sleep_for(kPoll);
  }
}

absl::StatusOr<std::vector<std::string>> ShownPattern::wait() {
  v1::ShowPatternResponse shown;
  if (!reader_->Read(&shown)) {
    const absl::Status end = wait_for_end();
    return end.ok() ? absl::UnavailableError(server_.title + " shows no pattern") : end;
  }
  return std::vector<std::string>(shown.monitors().begin(), shown.monitors().end());
}

absl::Status ShownPattern::wait_for_end() {
  for (v1::ShowPatternResponse response; reader_->Read(&response);) {
  }
  ended_ = true;
  return status_from(reader_->Finish(), server_.title);
}

}  // namespace glasswing
