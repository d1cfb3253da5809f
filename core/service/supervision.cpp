#include "core/service/supervision.h"

#include <pthread.h>
#include <spdlog/spdlog.h>
#include <sys/time.h>
#include <systemd/sd-daemon.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>

namespace glasswing {
namespace {

sigset_t stop_signals() {
  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGINT);
  ::sigaddset(&signals, SIGTERM);
  return signals;
}

// Time between two calls of `alive`; a day without a watchdog.
timespec period() {
  std::uint64_t watchdog_us = 0;
  if (::sd_watchdog_enabled(0, &watchdog_us) <= 0) return {.tv_sec = 86400, .tv_nsec = 0};
  const std::uint64_t us = watchdog_us / 3;
  return {.tv_sec = static_cast<time_t>(us / 1000000), .tv_nsec = static_cast<long>(us % 1000000) * 1000};
}

}  // namespace

void block_signals() {
  const sigset_t signals = stop_signals();
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
}

void serve_until_signal(const std::function<bool()>& alive) {
  const sigset_t signals = stop_signals();
  const timespec wait = period();
  ::sd_notify(0, "READY=1");
  while (::sigtimedwait(&signals, nullptr, &wait) < 0) {
    if (errno != EAGAIN) continue;
    if (alive()) {
      ::sd_notify(0, "WATCHDOG=1");
    } else {
      spdlog::error("this daemon does not answer its own calls; the watchdog is not fed");
    }
  }
  ::sd_notify(0, "STOPPING=1");
}

}  // namespace glasswing
