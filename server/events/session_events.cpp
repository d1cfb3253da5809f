#include "server/events/session_events.h"

#include <algorithm>

#include "server/sessions/session_state.h"

namespace glasswing {

SessionEvents::Seen SessionEvents::seen(const v1::Session& session) {
  const std::string& reason = session.reason();
  return {.state = session.state(),
          .stalled = reason.starts_with(kStalled),
          .lacks_room = reason.starts_with(kWaitsForRoom) || reason.starts_with(kWaitsForServerRoom),
          .rig_changes = session.rig_changes_size()};
}

std::vector<Event> SessionEvents::events_of(const v1::Session& session) {
  const Seen now = seen(session), before = std::exchange(seen_[session.name()], now);
  const std::string& name = session.name();
  std::vector<Event> events;
  const auto add = [&](std::string_view what, const std::string& text, const std::string& advice) {
    events.push_back({.what = what, .session = name, .text = text, .advice = advice});
  };
  const bool entered = now.state != before.state;
  if (entered && now.state == v1::SESSION_STATE_DONE)
    add("session-done", "session " + name + " is done", "glasswing fetch " + name + " -o " + name + ".exr");
  if (entered && now.state == v1::SESSION_STATE_PAUSED)
    add("paused", "session " + name + " is paused: " + session.reason(), "glasswing resume " + name);
  if (entered && now.state == v1::SESSION_STATE_FAILED)
    add("needs-operator", "session " + name + " failed: " + session.reason(), "glasswing show " + name);
  if (now.stalled && !before.stalled)
    add("needs-operator", "session " + name + " is " + session.reason(), "glasswing show " + name);
  if (now.lacks_room && !before.lacks_room)
    add("disk-low", "session " + name + " is " + session.reason(),
        "free space there; the work then continues by itself");
  for (int i = before.rig_changes; i < now.rig_changes; ++i) {
    const v1::RigChange& change = session.rig_changes(i);
    const bool touched = change.what().find(kTouched) != std::string::npos;
    add(touched ? "knocked" : "drift", "session " + name + ": " + change.what(), change.advice());
  }
  return events;
}

}  // namespace glasswing
