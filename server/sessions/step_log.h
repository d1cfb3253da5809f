// The events of each step of a capture, for watchers. In memory only, for the most recently captured
// sessions; proofs are durable in the archive.
#pragma once

#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Thread-safe.
class StepLog {
 public:
  static constexpr size_t kMaxSessions = 32;
  static constexpr size_t kMaxEvents = 50'000;  // of a session; after these only proofs are kept

  // Ignores events of a step that is proven.
  void add(const std::string& session, v1::StepEvent event);
  // The session's events from the `first` on, oldest first. Empty: nothing is known about this session.
  std::optional<std::vector<v1::StepEvent>> events(const std::string& session, size_t first) const;

 private:
  struct Entry {
    std::string session;
    std::vector<v1::StepEvent> events;
    std::set<int> proven;
  };
  mutable std::mutex mutex_;
  std::deque<Entry> entries_;  // newest last
};

// The event of a step whose frame is kept.
v1::StepEvent proof_of(const v1::Frame& frame, double seconds);

// The events that can be derived from an archive: proofs, in the order of exposure.
std::vector<v1::StepEvent> proven_steps(const v1::CaptureManifest& manifest);

}  // namespace glasswing
