// A daemon's life as its supervisor (systemd, or whoever started it) sees it.
#pragma once

#include <functional>

namespace glasswing {

// Call first in main, before any thread: from then on SIGINT and SIGTERM wait for serve_until_signal().
void block_signals();

// Tells systemd that the daemon is up (Type=notify), and returns when SIGINT or SIGTERM arrives, having told
// that it ends. Where the unit has WatchdogSec, `alive` is asked three times as often as that, and must
// answer sooner; while it says false the watchdog hears nothing, and systemd starts the daemon anew.
void serve_until_signal(const std::function<bool()>& alive);

}  // namespace glasswing
