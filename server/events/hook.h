// A command that the server runs on notable events.
#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/events/session_events.h"

namespace glasswing {

struct HookOptions {
  std::string command = {};                 // words divided by spaces, which no shell sees; empty: none
  std::string events = {};                  // of kEvents, divided by commas; empty: all
  std::chrono::milliseconds limit{30'000};  // of a run
};

// Runs the command once for each event, one after another, with the event as JSON on its standard input.
// Thread-safe.
class Hook {
 public:
  // INVALID_ARGUMENT: unknown events.
  static absl::StatusOr<std::unique_ptr<Hook>> create(const HookOptions& options);
  ~Hook();

  // Counts the event, and queues a run; beyond kMaxQueued the event is dropped, counted and logged.
  void add(const Event& event);

  static constexpr size_t kMaxQueued = 100;

 private:
  Hook(std::vector<std::string> words, std::set<std::string> events, std::chrono::milliseconds limit);
  void run(std::stop_token stop);

  const std::vector<std::string> words_;  // none: events are counted only
  const std::set<std::string> events_;
  const std::chrono::milliseconds limit_;
  std::mutex mutex_;
  std::condition_variable_any added_;
  std::deque<std::string> queue_;  // guarded by mutex_; JSON
  std::jthread thread_;
};

}  // namespace glasswing
