#include "client/rig/shown_pattern.h"

namespace glasswing {
namespace {

constexpr std::chrono::hours kLongest(24);

}  // namespace

ShownPattern::ShownPattern(const Client& client, const std::string& pattern,
                           const std::vector<std::string>& monitors)
    : server_(client.server_title(), client.server) {
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
