#include "client/cli/session_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <map>

#include "core/base/utf8.h"
#include "core/cli/output.h"
#include "core/method/methods.h"

namespace glasswing {
namespace {

// "300 frames, 7 of them lost"
std::string video_text(const v1::Session& session) {
  const int lost = session.lost_frames_size();
  return fmt::format("{} frames{}", session.frame_count(),
                     lost > 0 ? fmt::format(", {} of them lost", lost) : "");
}

// "gaussian", "gaussian (images=100, modes=2)"
std::string method_text(const v1::Session& session) {
  std::map<std::string, std::string> sorted(session.options().begin(), session.options().end());
  std::string options;
  for (const auto& [name, value] : sorted) options += (options.empty() ? "" : ", ") + name + "=" + value;
  return session.method() + (options.empty() ? "" : " (" + options + ")");
}

}  // namespace

std::string state_name(v1::SessionState state) {
  switch (state) {
    case v1::SESSION_STATE_CREATED:
      return "created";
    case v1::SESSION_STATE_CAPTURING:
      return "capturing";
    case v1::SESSION_STATE_PAUSED:
      return "paused";
    case v1::SESSION_STATE_CAPTURED:
      return "captured";
    case v1::SESSION_STATE_SOLVING:
      return "solving";
    case v1::SESSION_STATE_DONE:
      return "done";
    case v1::SESSION_STATE_FAILED:
      return "failed";
    case v1::SESSION_STATE_CANCELLED:
      return "cancelled";
    default:
      return "unknown";
  }
}

bool allows(const v1::Session& session, v1::SessionAction action) {
  return std::ranges::find(session.allowed_actions(), action) != session.allowed_actions().end();
}

std::string tiles_text(const v1::Session& session) {
  if (session.tile_count() == 0) return "estimating the work";
  return fmt::format("{} of {} tiles", session.tiles_done(), session.tile_count());
}

std::string waiting_text(const v1::Session& session) {
  const v1::Waiting& waiting = session.waiting();
  if (!session.has_waiting()) return "";
  return fmt::format("{}{}; {}", waiting.what(), waiting.since().empty() ? "" : ", since " + waiting.since(),
                     waiting.advice());
}

namespace {

// For a captured session with some steps proven by time alone.
std::string by_time_text(const v1::Session& session) {
  if (session.time_proven_count() == 0) return "";
  return fmt::format("; {} of {} steps are proven by time alone", session.time_proven_count(),
                     session.step_count());
}

}  // namespace

std::string summary_of(const v1::Session& session) {
  std::string line = fmt::format("session {} is {}", session.name(), state_name(session.state()));
  // For a paused session the reason says more.
  if (session.has_waiting() && session.state() != v1::SESSION_STATE_PAUSED)
    return line + ", and waits: " + waiting_text(session);
  if (!session.reason().empty()) return line + ": " + session.reason();
  switch (session.state()) {
    case v1::SESSION_STATE_CAPTURING:
    case v1::SESSION_STATE_PAUSED:
      return line + fmt::format(": {} of {} steps", session.proven_count(), session.step_count());
    case v1::SESSION_STATE_CAPTURED:
      if (session.frame_count() > 0) line += fmt::format(": a video of {}", video_text(session));
      // Imported frames have no capture time.
      if (session.frames_taken() == 0) return line + fmt::format(": {} frames", session.step_count());
      return line + fmt::format(": {} steps ({} retaken) in {}, {} frames taken{}", session.step_count(),
                                session.retaken_count(), seconds_text(session.capture_seconds()),
                                session.frames_taken(), by_time_text(session));
    case v1::SESSION_STATE_SOLVING:
      line += " by " + method_text(session);
      if (is_video(session) && !session.matte_ready())  // otherwise the frames are the previous solve's
        return line +
               fmt::format(": {} of {} frames", session.solved_frames_size(), frames_to_solve(session));
      return line + ": " + tiles_text(session);
    case v1::SESSION_STATE_DONE:
      if (is_video(session))
        return line + fmt::format(": mattes of {}, solved by {} in {}{}", video_text(session),
                                  method_text(session), seconds_text(session.solve_seconds()),
                                  by_time_text(session));
      return line + fmt::format(": {} of {} pixels show the object ({} flagged){}, solved by {} in {}{}",
                                session.object_pixel_count(), session.pixel_count(),
                                session.flagged_pixel_count(), unsolved_text(session.unsolved_pixel_count()),
                                method_text(session), seconds_text(session.solve_seconds()),
                                by_time_text(session));
    default:
      return line;
  }
}

void print_session(const v1::Session& session, bool json) {
  if (json) {
    print_json(session);
  } else {
    std::cout << printable(summary_of(session)) << "\n";
  }
}

bool is_video(const v1::Session& session) {
  return session.frame_count() > 0 && session.method() == kRampMethod;
}

int frames_to_solve(const v1::Session& session) {
  return session.frame_count() - session.lost_frames_size();
}

namespace {

void add_range(int first, int last, std::string& text) {
  text +=
      fmt::format("{}{}{}", text.empty() ? "" : ", ", first, last > first ? fmt::format(" to {}", last) : "");
}

}  // namespace

std::string ranges_text(const google::protobuf::RepeatedField<std::int32_t>& numbers) {
  std::string text;
  for (int i = 0; i < numbers.size();) {
    int last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    add_range(numbers[i], numbers[last], text);
    i = last + 1;
  }
  return text;
}

std::string ranges_text(const google::protobuf::RepeatedPtrField<v1::StepRange>& steps) {
  std::string text;
  for (const v1::StepRange& range : steps) add_range(range.first(), range.last(), text);
  return text;
}

std::string describe(const v1::RigChange& change) {
  return fmt::format("after {} of capture, {}; {}", seconds_text(change.seconds()), change.what(),
                     change.advice());
}

}  // namespace glasswing
