// Watches sessions and the server's disk for events.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <stop_token>
#include <thread>

#include "server/events/hook.h"
#include "server/events/session_events.h"
#include "server/sessions/session_store.h"

namespace glasswing {

class EventWatch {
 public:
  // `data`: the directory whose disk is watched.
  EventWatch(SessionStore& sessions, std::filesystem::path data, Hook& hook);
  ~EventWatch();

 private:
  void watch_disk(std::stop_token stop);

  SessionStore& sessions_;
  const std::filesystem::path data_;
  Hook& hook_;
  SessionEvents events_;  // used under the store's Edit
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread disk_;
};

}  // namespace glasswing
