#include "server/selftest/rig_findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/pattern/describe_step.h"
#include "core/pattern/id_patch.h"
#include "core/radiometry/tone_curve.h"

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

// Limits of the sum of all clocks' bounds.
constexpr nanoseconds kClocksGood = milliseconds(1), kClocksPoor = milliseconds(4);
// Limits as shares of pictures, frames and steps.
constexpr double kManyMissed = 0.1, kFewDropped = 0.01, kManyDropped = 0.25;
constexpr double kWellProven = 0.9, kHardlyProven = 0.3;
constexpr double kManyRetaken = 0.05;
constexpr double kRateOff = 0.05;  // of the camera's declared rate
constexpr nanoseconds kSyncAgrees = microseconds(300);

double ms(nanoseconds time) {
  return 1e-6 * static_cast<double>(time.count());
}
double ms(std::int64_t ns) {
  return ms(nanoseconds(ns));
}

nanoseconds longest_period(const TestCaptureTimes& times) {
  nanoseconds longest{};
  for (const TestCaptureTimes::Shown& shown : times.shown) longest = std::max(longest, shown.period);
  return longest;
}

// The median: a missed flip makes single windows longer.
nanoseconds typical_window(const TestCaptureTimes& times) {
  std::vector<nanoseconds> lengths;
  for (const StableWindow& window : times.windows) lengths.push_back(window.until - window.from);
  if (lengths.empty()) return nanoseconds(0);
  const auto middle = lengths.begin() + lengths.size() / 2;
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

nanoseconds frame_uncertainty(const TestCaptureTimes& times) {
  nanoseconds most{};
  for (const FrameTime& frame : times.frames) most = std::max(most, frame.uncertainty);
  return most;
}

}  // namespace

v1::Finding make_finding(v1::FindingLevel level, const std::string& subject, const std::string& text,
                         const std::string& advice) {
  v1::Finding finding;
  finding.set_level(level);
  finding.set_subject(subject);
  finding.set_text(text);
  finding.set_advice(advice);
  return finding;
}

v1::Finding judge_clocks(const std::vector<std::pair<std::string, nanoseconds>>& errors) {
  std::string text;
  nanoseconds sum{};
  for (const auto& [node, error] : errors) {
    text += fmt::format("{}{}: {:.2f} ms", text.empty() ? "clocks are known to " : ", ", node, ms(error));
    sum += error;
  }
  if (sum <= kClocksGood) return make_finding(v1::FINDING_LEVEL_OK, "clocks", text);
  return make_finding(
      sum <= kClocksPoor ? v1::FINDING_LEVEL_WARNING : v1::FINDING_LEVEL_PROBLEM, "clocks",
      text + "; every proof loses twice as much",
      "use a wired network, and reduce the load on the nodes: the bound is half of the fastest answer time");
}

v1::Finding judge_flips(const TestCaptureTimes& times) {
  const nanoseconds wanted = times.hold_refreshes * longest_period(times);
  size_t missed = 0;
  for (const TestCaptureTimes::Shown& shown : times.shown)
    missed += shown.held > wanted + shown.period * 3 / 4 ? 1 : 0;
  const std::string text = fmt::format(
      "{} of {} pictures stayed too long, as the next one missed its refresh", missed, times.shown.size());
  if (missed == 0)
    return make_finding(v1::FINDING_LEVEL_OK, "flips",
                        fmt::format("all {} pictures changed in time", times.shown.size()));
  const bool many = static_cast<double>(missed) > kManyMissed * static_cast<double>(times.shown.size());
  return make_finding(
      many ? v1::FINDING_LEVEL_PROBLEM : v1::FINDING_LEVEL_WARNING, "flips", text,
      "reduce the load on the display node's machine, switch off compositing and variable refresh rates, or "
      "choose a larger hold_refreshes");
}

v1::Finding judge_frames(const TestCaptureTimes& times) {
  if (times.frames.size() < 2) {
    return make_finding(v1::FINDING_LEVEL_PROBLEM, "camera",
                        fmt::format("{} frames arrived", times.frames.size()),
                        "look at the camera node's log");
  }
  const FrameTime &first = times.frames.front(), &last = times.frames.back();
  const auto numbers = static_cast<double>(last.sequence - first.sequence);
  const double dropped = 1.0 - static_cast<double>(times.frames.size() - 1) / numbers;
  const double period_ms = ms(last.start - first.start) / numbers;
  const double declared_ms = ms(times.frame_period);
  const std::string text =
      fmt::format("{:.1f} frames per second, {:.1f} % of them dropped", 1000.0 / period_ms, 100.0 * dropped);
  if (dropped > kFewDropped) {
    return make_finding(dropped > kManyDropped ? v1::FINDING_LEVEL_PROBLEM : v1::FINDING_LEVEL_WARNING,
                        "camera", text,
                        "reduce the load on the camera node, or choose a smaller picture or a lower frame "
                        "rate");
  }
  if (!times.triggered && std::abs(period_ms - declared_ms) > kRateOff * declared_ms) {
    return make_finding(v1::FINDING_LEVEL_WARNING, "camera",
                        text + fmt::format("; the camera promises {:.1f}", 1000.0 / declared_ms),
                        "choose a shorter exposure, a smaller picture, or a lower frame rate");
  }
  return make_finding(v1::FINDING_LEVEL_OK, "camera", text);
}

v1::Finding judge_window(const TestCaptureTimes& times, nanoseconds exposure, nanoseconds shortest) {
  const nanoseconds window = typical_window(times);
  const nanoseconds needed = exposure + times.readout + 2 * frame_uncertainty(times);
  const nanoseconds refresh = std::max(longest_period(times), nanoseconds(1));
  const auto hold_for = [&](nanoseconds length) {
    const nanoseconds lacking = std::max(length - window, nanoseconds(0));
    return times.hold_refreshes + static_cast<int>((lacking + refresh - nanoseconds(1)) / refresh);
  };
  const auto advice_for = [&](nanoseconds length) {
    const nanoseconds fitting = exposure - (length - window);
    std::string advice = fmt::format("set hold_refreshes to {}", hold_for(length));
    if (fitting >= shortest)
      advice += fmt::format(", or exposure_ms to {:.2f} or less",
                            1e-2 * static_cast<double>(fitting / microseconds(10)));
    return advice;
  };
  const std::string text = fmt::format(
      "{:.2f} ms exposures need {:.2f} ms with readout and uncertainty; a picture is stable for {:.2f} ms",
      ms(exposure), ms(needed), ms(std::max(window, nanoseconds(0))));
  if (needed > window) return make_finding(v1::FINDING_LEVEL_PROBLEM, "window", text, advice_for(needed));
  const nanoseconds shown = times.hold_refreshes * refresh;
  if (times.triggered && times.frame_period > shown) {
    return make_finding(
        v1::FINDING_LEVEL_WARNING, "window",
        text + fmt::format(", but it is shown for {:.2f} ms, and the camera is ready again after {:.2f} ms",
                           ms(shown), ms(times.frame_period)),
        fmt::format(
            "set hold_refreshes to {}",
            times.hold_refreshes + (times.frame_period - shown + refresh - nanoseconds(1)) / refresh));
  }
  const nanoseconds sure = times.triggered ? needed : needed + times.frame_period;
  if (sure <= window) return make_finding(v1::FINDING_LEVEL_OK, "window", text);
  const double share = ms(window - needed) / ms(times.frame_period);
  return make_finding(
      v1::FINDING_LEVEL_WARNING, "window",
      text + fmt::format(", and a frame begins every {:.2f} ms: {:.0f} of 100 fit at the first showing",
                         ms(times.frame_period), 100.0 * share),
      advice_for(sure) + ", or use a faster camera");
}

v1::Finding judge_proof(const TestCaptureTimes& times) {
  FrameMatcher matcher;
  for (const FrameTime& frame : times.frames) matcher.add_frame(frame);
  for (const StableWindow& window : times.windows) matcher.add_window(window);
  const size_t proven = matcher.take().size();
  const std::string text =
      fmt::format("{} of {} test steps were proven at the first showing", proven, times.windows.size());
  const double share =
      times.windows.empty() ? 0.0 : static_cast<double>(proven) / static_cast<double>(times.windows.size());
  if (share >= kWellProven) return make_finding(v1::FINDING_LEVEL_OK, "proof", text);
  const char* advice = "fix the problems above";
  if (share >= kHardlyProven) {
    return make_finding(v1::FINDING_LEVEL_WARNING, "proof",
                        text + fmt::format("; a capture takes about {:.1f} times as long", 1.0 / share),
                        advice);
  }
  return make_finding(v1::FINDING_LEVEL_PROBLEM, "proof", text, advice);
}

v1::Finding judge_patch(const v1::DisplayMonitor& monitor, int learning_steps,
                        const v1::UnseenPatch& unseen) {
  const std::string& name = monitor.name();
  if (monitor.patch_rows() == 0) {
    return make_finding(v1::FINDING_LEVEL_WARNING, "id patch",
                        name + " shows none: its frames are proven by time alone",
                        "start its display node with --patch-rows, and make sure that the camera sees those "
                        "rows");
  }
  const int wanted = static_cast<int>(patch_learning_ids().size());
  if (learning_steps < wanted) {
    return make_finding(
        v1::FINDING_LEVEL_WARNING, "id patch",
        fmt::format("{}: only {} of its {} learning pictures were recorded", name, learning_steps, wanted),
        "see the other findings; a capture repeats them");
  }
  if (unseen.contradicts()) {
    return make_finding(v1::FINDING_LEVEL_PROBLEM, "id patch",
                        fmt::format("{}: {}; a capture would fail", name, unseen.reason()),
                        fmt::format("run glasswing calibrate sync --monitor {}", name));
  }
  if (!unseen.reason().empty()) {
    return make_finding(
        v1::FINDING_LEVEL_WARNING, "id patch",
        fmt::format("{}: {}; its frames are proven by time alone", name, unseen.reason()),
        fmt::format("make sure that the camera sees all of its last {} rows in focus, with nothing in front "
                    "of them; if it cannot, start the display node with --patch-rows {}=0",
                    monitor.patch_rows(), name));
  }
  return make_finding(v1::FINDING_LEVEL_OK, "id patch",
                      fmt::format("{}: its id is read in its last {} rows", name, monitor.patch_rows()));
}

v1::Finding judge_camera_light(const v1::Camera& camera, const std::optional<v1::CameraCalibration>& measured,
                               nanoseconds longest) {
  if (!measured) {
    const bool linear = camera.response() == "linear";
    return make_finding(linear ? v1::FINDING_LEVEL_OK : v1::FINDING_LEVEL_WARNING, "light",
                        fmt::format("the response of {} is not measured; it is {} as linear", camera.name(),
                                    linear ? "declared" : "treated"),
                        linear ? "" : "glasswing calibrate camera");
  }
  const std::string text =
      fmt::format("{} is {} (measured {})", camera.name(),
                  measured->linear() ? "linear" : "curved, and its curve is known", measured->measured());
  if (measured->white_ms() > 0.0 && ms(longest) > measured->white_ms()) {
    return make_finding(
        v1::FINDING_LEVEL_WARNING, "light",
        fmt::format(
            "{}; white reaches full scale at {:.3g} ms, exposures are up to {:.3g} ms: bright pixels clip",
            text, measured->white_ms(), ms(longest)),
        fmt::format("expose for less than {:.3g} ms, or add such an exposure", measured->white_ms()));
  }
  return make_finding(v1::FINDING_LEVEL_OK, "light", text);
}

v1::Finding judge_monitor_light(const v1::DisplayMonitor& monitor,
                                const std::optional<v1::DisplayCalibration>& measured) {
  if (measured) {
    return make_finding(v1::FINDING_LEVEL_OK, "light",
                        fmt::format("{} has measured curves ({})", monitor.name(), measured->measured()));
  }
  if (monitor.bits() > kMaxCurveBits) {
    return make_finding(v1::FINDING_LEVEL_OK, "light",
                        fmt::format("{} uses linear {}-bit codes", monitor.name(), monitor.bits()));
  }
  return make_finding(
      v1::FINDING_LEVEL_WARNING, "light",
      fmt::format("the response of {} is not measured; it is treated as linear, which no real monitor is",
                  monitor.name()),
      "glasswing calibrate display --monitor " + monitor.name());
}

v1::Finding judge_sync(const v1::DisplayMonitor& declared, const std::optional<v1::MonitorSync>& measured) {
  const std::string said = fmt::format("{} declares {:.2f} ms lag and {:.2f} ms settling", declared.name(),
                                       ms(declared.optical_lag_ns()), ms(declared.settle_ns()));
  if (!measured) {
    return make_finding(v1::FINDING_LEVEL_WARNING, "sync", "display latency is not measured: " + said,
                        "glasswing calibrate sync --monitor " + declared.name());
  }
  const std::string text =
      fmt::format("{} follows its scan-out by {:.2f} ms and settles in {:.2f} ms, +- {:.2f} (measured {})",
                  declared.name(), ms(measured->lag_ns()), ms(measured->settle_ns()),
                  ms(measured->error_ns()), measured->measured());
  const nanoseconds tolerance =
      kSyncAgrees + 3 * nanoseconds(measured->error_ns()) + nanoseconds(measured->clock_error_ns());
  const auto apart = [](std::int64_t a, std::int64_t b) { return std::chrono::abs(nanoseconds(a - b)); };
  const bool agrees = apart(measured->lag_ns(), declared.optical_lag_ns()) <= tolerance &&
                      measured->settle_ns() <= declared.settle_ns() + tolerance.count();
  if (agrees) return make_finding(v1::FINDING_LEVEL_OK, "sync", text);
  return make_finding(
      v1::FINDING_LEVEL_WARNING, "sync", text + "; " + said + "; the measured values are used",
      fmt::format("if the monitor or its mode changed since, measure again; if not, start its node with "
                  "--lag-ms {:.1f} --settle-ms {:.1f}",
                  ms(measured->lag_ns()), ms(measured->settle_ns())));
}

std::string retake_advice(v1::RetakeCause cause) {
  switch (cause) {
    case v1::RETAKE_CAUSE_NOT_SHOWN:
      return "reduce the load on the display node's machine, or choose a larger hold_refreshes";
    case v1::RETAKE_CAUSE_NO_FRAME:
      return "reduce the load on the camera node, or choose a smaller picture or a lower frame rate";
    case v1::RETAKE_CAUSE_WRONG_ID:
      return "a display or the camera reports wrong times: glasswing calibrate sync";
    case v1::RETAKE_CAUSE_ID_UNREADABLE:
      return "the camera sees the id patch, but cannot distinguish its cells beside a picture: the patch "
             "must "
             "cover at least six rows of the camera's picture, and be in focus; start the display node with "
             "more --patch-rows, or make the monitor larger in the camera's picture. If it already does, "
             "exposures overlap two pictures: glasswing calibrate sync";
    case v1::RETAKE_CAUSE_TOO_LATE:
      return "frames arrive faster than the camera node stores them: reduce the load on its machine and "
             "disk, "
             "or choose a larger hold_refreshes or a smaller picture";
    case v1::RETAKE_CAUSE_PATCH_UNSEEN:
      return "make sure that the camera sees each monitor's whole id patch in focus, with nothing in front "
             "of "
             "it";
    default:
      return "the camera's exposures must fit between a picture's settling and the next one: try a shorter "
             "exposure_ms or a larger hold_refreshes";
  }
}

std::optional<v1::Finding> judge_retakes(const v1::Session& session) {
  if (session.retaken_count() <= kManyRetaken * session.step_count() || session.retakes().empty())
    return std::nullopt;
  std::vector<v1::RetakeCount> counts(session.retakes().begin(), session.retakes().end());
  std::ranges::sort(counts, std::greater(), &v1::RetakeCount::count);
  std::string text = fmt::format("session {} repeated its {} steps {} times", session.name(),
                                 session.step_count(), session.retaken_count());
  for (const v1::RetakeCount& count : counts)
    text += fmt::format("{}{}: {}", &count == &counts.front() ? "; " : ", ", describe(count.cause()),
                        count.count());
  return make_finding(v1::FINDING_LEVEL_WARNING, "retakes", text, retake_advice(counts.front().cause()));
}

}  // namespace glasswing
