#include "server/events/hook.h"

#include <absl/strings/str_split.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/base/time.h"
#include "core/base/utf8.h"
#include "core/process/run_program.h"
#include "core/telemetry/metrics.h"

namespace glasswing {
namespace {

// Each is present, as 0, from the first call on.
prometheus::Counter& happened(std::string_view event) {
  return counter("glasswing_events_total", "Notable events.", {{"event", std::string(event)}});
}
prometheus::Counter& ran(const char* outcome) {
  return counter("glasswing_hooks_total", "Runs of the hook command, and events dropped before theirs.",
                 {{"outcome", outcome}});
}

std::string json_of(const Event& event) {
  const nlohmann::ordered_json json = {{"event", event.what},
                                       {"time", utc_now_rfc3339()},
                                       {"session", event.session},
                                       {"text", printable(event.text)},
                                       {"advice", printable(event.advice)}};
  return json.dump() + "\n";
}

}  // namespace

absl::StatusOr<std::unique_ptr<Hook>> Hook::create(const HookOptions& options) {
  std::set<std::string> events = absl::StrSplit(options.events, ',', absl::SkipWhitespace());
  for (const std::string& event : events) {
    if (std::ranges::find(kEvents, event) == kEvents.end()) {
      return absl::InvalidArgumentError(
          fmt::format("--hook-events has \"{}\"; the events are {}", event, fmt::join(kEvents, ", ")));
    }
  }
  if (events.empty()) events.insert(kEvents.begin(), kEvents.end());
  for (const std::string_view event : kEvents) happened(event);
  for (const char* outcome : {"done", "failed", "dropped"}) ran(outcome);
  return std::unique_ptr<Hook>(new Hook(command_words(options.command), std::move(events), options.limit));
}

Hook::Hook(std::vector<std::string> words, std::set<std::string> events, std::chrono::milliseconds limit)
    : words_(std::move(words)),
      events_(std::move(events)),
      limit_(limit),
      thread_([this](std::stop_token stop) { run(std::move(stop)); }) {}

Hook::~Hook() = default;

void Hook::add(const Event& event) {
  happened(event.what).Increment();
  spdlog::info("event what={} session={} text=\"{}\"", event.what, event.session, printable(event.text));
  if (words_.empty() || !events_.contains(std::string(event.what))) return;
  {
    const std::lock_guard lock(mutex_);
    if (queue_.size() < kMaxQueued) {
      queue_.push_back(json_of(event));
      added_.notify_one();
      return;
    }
  }
  ran("dropped").Increment();
  spdlog::error("hook not run: {} events wait event={} session={}", kMaxQueued, event.what, event.session);
}

void Hook::run(std::stop_token stop) {
  while (true) {
    std::string json;
    {
      std::unique_lock lock(mutex_);
      if (!added_.wait(lock, stop, [this] { return !queue_.empty(); })) return;
      json = std::move(queue_.front());
      queue_.pop_front();
    }
    const absl::StatusOr<ProgramEnd> end =
        run_program(words_, {.limit = limit_, .stop = stop, .input = json});
    const bool done = end.ok() && end->status == 0;
    ran(done ? "done" : "failed").Increment();
    if (done) continue;
    spdlog::error("hook failed error=\"{}\"", end.ok()
                                                  ? fmt::format("exit status {}: {}", end->status, end->error)
                                                  : std::string(end.status().message()));
  }
}

}  // namespace glasswing
