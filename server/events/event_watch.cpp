#include "server/events/event_watch.h"

#include <fmt/format.h>

#include <chrono>
#include <system_error>

namespace glasswing {
namespace {

constexpr std::chrono::seconds kLookEvery(10);
constexpr double kLow = 0.1, kEnoughAgain = 0.12;  // free fraction of the disk

}  // namespace

EventWatch::EventWatch(SessionStore& sessions, std::filesystem::path data, Hook& hook)
    : sessions_(sessions), data_(std::move(data)), hook_(hook) {
  // Changes between the list and the observer are reported as news, which they are.
  if (const auto known = sessions_.list({}); known.ok()) {
    for (const v1::Session& session : *known) events_.know(session);
  }
  sessions_.observe([this](const v1::Session& session) {
    for (const Event& event : events_.events_of(session)) hook_.add(event);
  });
  disk_ = std::jthread([this](std::stop_token stop) { watch_disk(std::move(stop)); });
}

EventWatch::~EventWatch() {
  sessions_.observe(nullptr);
}

void EventWatch::watch_disk(std::stop_token stop) {
  bool low = false;
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    std::error_code failed;
    const std::filesystem::space_info space = std::filesystem::space(data_, failed);
    if (!failed && space.capacity > 0) {
      const double free = static_cast<double>(space.available) / static_cast<double>(space.capacity);
      if (!low && free < kLow) {
        hook_.add(
            {.what = "disk-low",
             .session = "",
             .text = fmt::format("the server's disk has {:.0f} % left ({})", 100.0 * free, data_.string()),
             .advice = "delete sessions that are no longer needed, or add disk space"});
      }
      low = free < (low ? kEnoughAgain : kLow);
    }
    wake_.wait_for(lock, stop, kLookEvery, [] { return false; });
  }
}

}  // namespace glasswing
