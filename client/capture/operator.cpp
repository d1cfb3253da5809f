#include "client/capture/operator.h"

#include <unistd.h>

#include <iostream>

namespace glasswing {

bool can_ask() {
  return ::isatty(STDIN_FILENO) == 1;
}

absl::Status ask_operator(const std::string& what) {
  std::cerr << what << ", then press Enter: " << std::flush;
  std::string line;
  if (std::getline(std::cin, line)) return absl::OkStatus();
  std::cerr << "\n";
  return absl::CancelledError("standard input ended while you were asked to " + what);
}

bool waits_for_object(const v1::Session& session) {
  return session.state() == v1::SESSION_STATE_PAUSED && (session.reason().starts_with("place the object") ||
                                                         session.reason().starts_with("take the object"));
}

std::string what_to_do(const v1::Session& session) {
  return session.reason().substr(0, session.reason().find(','));
}

}  // namespace glasswing
