#include "display-node/playback/player.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>

#include "core/base/status.h"
#include "display-node/display_metrics.h"
#include "display-node/playback/picture_queue.h"

namespace glasswing {
namespace {

constexpr nanoseconds kForever = std::chrono::hours(24 * 365);

// Returns early when stopped.
void wait_until(nanoseconds deadline, std::stop_token stop) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  const std::chrono::steady_clock::time_point until(deadline);  // CLOCK_MONOTONIC
  std::condition_variable_any().wait_until(lock, stop, until, [] { return false; });
}

void count_step(const std::vector<ScreenInfo>& screens, const std::vector<Scanout>& scanouts,
                nanoseconds at) {
  display_metrics().steps_shown.Increment();
  for (size_t m = 0; m < screens.size(); ++m) {
    if (scanouts[m].start - at < period_of(screens[m])) continue;
    display_metrics().steps_late.Increment();
    return;
  }
}

// `replaced`: when the next picture's first row was scanned out; null: the step is still shown.
v1::Presentation presentation_of(int step, const ScreenInfo& screen, const Scanout& shown,
                                 const Scanout* replaced) {
  v1::Presentation presentation;
  presentation.set_step(step);
  presentation.set_monitor(screen.name);
  presentation.set_scanout_start_ns(shown.start.count());
  presentation.set_scanout_end_ns((shown.start + screen.scanout).count());
  presentation.set_uncertainty_ns(shown.uncertainty.count());
  if (replaced == nullptr) return presentation;
  const double held = static_cast<double>((replaced->start - shown.start).count());
  presentation.set_replaced_ns(replaced->start.count());
  presentation.set_refreshes(
      static_cast<int>(std::lround(held / static_cast<double>(period_of(screen).count()))));
  presentation.set_uncertainty_ns(std::max(shown.uncertainty, replaced->uncertainty).count());
  return presentation;
}

}  // namespace

absl::Status play(const Program& program, Display& display, nanoseconds start, nanoseconds step,
                  std::stop_token stop, const std::function<void(const v1::Presentation&)>& report,
                  bool hold_last) {
  const nanoseconds now = monotonic_now();
  if (now > start) {
    return absl::DeadlineExceededError(
        fmt::format("the program should have started {} ms ago; it was not played",
                    std::chrono::duration<double, std::milli>(now - start).count()));
  }
  const std::vector<ScreenInfo>& screens = display.screens();
  std::vector<Scanout> shown;  // of the step before
  nanoseconds longest_refresh{};
  for (const ScreenInfo& screen : screens) longest_refresh = std::max(longest_refresh, period_of(screen));
  nanoseconds at = start;
  PictureQueue queue(program);
  std::vector<Picture> pictures = queue.next();
  for (size_t i = 0; i <= program.size(); ++i) {
    // Waits here, where it can be stopped, up to a refresh early in case it wakes up late.
    wait_until(at - longest_refresh, stop);
    const bool stopped = stop.stop_requested();
    const bool blank = i == program.size() || stopped;
    if (stopped) at = monotonic_now();
    if (blank) pictures.assign(screens.size(), nullptr);
    GW_ASSIGN_OR_RETURN(const std::vector<Scanout> scanouts, display.show(pictures, at));
    if (i > 0) {
      for (size_t m = 0; m < screens.size(); ++m)
        report(presentation_of(program.number(i - 1), screens[m], shown[m], &scanouts[m]));
    }
    if (blank) return stopped ? absl::CancelledError("the program was stopped") : absl::OkStatus();
    count_step(screens, scanouts, at);
    shown = scanouts;
    if (hold_last && i + 1 == program.size()) {
      for (size_t m = 0; m < screens.size(); ++m)
        report(presentation_of(program.number(i), screens[m], shown[m], nullptr));
      at += kForever;
    } else if (step > nanoseconds(0)) {
      at += step;  // a late step is shown for less time, and the next one is on time again
    } else {
      // Half a refresh early, so that rounding never adds a refresh. Every monitor shows the step for at
      // least hold_refreshes.
      at = nanoseconds::min();
      for (size_t m = 0; m < screens.size(); ++m) {
        const nanoseconds period = period_of(screens[m]);
        at = std::max(at, shown[m].start + program.hold_refreshes() * period - period / 2);
      }
    }
    if (i + 1 < program.size()) pictures = queue.next();
  }
  return absl::OkStatus();
}

}  // namespace glasswing
