// Notable events of sessions.
#pragma once

#include <array>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "glasswing/v1/session.pb.h"

namespace glasswing {

// All events, as --hook-events and the hook's JSON name them.
inline constexpr std::array<std::string_view, 7> kEvents{
    "session-done", "needs-operator", "paused", "disk-low", "drift", "knocked", "queue-done"};

struct Event {
  std::string_view what;  // of kEvents
  std::string session;    // empty: of none
  std::string text;       // human-readable: what happened
  std::string advice;     // what to do; may be empty
};

// Not thread-safe.
class SessionEvents {
 public:
  // A session's state when watching begins.
  void know(const v1::Session& session) { seen_[session.name()] = seen(session); }
  // What happened between the last change of this session and this one. A session that is not known is new.
  std::vector<Event> events_of(const v1::Session& session);

 private:
  struct Seen {
    v1::SessionState state = v1::SESSION_STATE_CREATED;
    bool stalled = false, lacks_room = false;
    int rig_changes = 0;
  };
  static Seen seen(const v1::Session& session);

  std::map<std::string, Seen> seen_;  // by name
};

}  // namespace glasswing
