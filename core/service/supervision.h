// Signals and systemd: how a daemon's supervisor sees it start, live and stop.
#pragma once

#include <functional>

namespace glasswing {

// Call before starting any thread: from then on SIGINT and SIGTERM stay pending until serve_until_signal().
void block_signals();

// Tells systemd that the daemon is up (Type=notify), and returns when SIGINT or SIGTERM arrives, after
// telling it that the daemon stops. If the unit has WatchdogSec, `alive` is called every third of that time,
// and must return sooner; while it returns false the watchdog is not fed, so that systemd restarts the
// daemon.
void serve_until_signal(const std::function<bool()>& alive);

}  // namespace glasswing
