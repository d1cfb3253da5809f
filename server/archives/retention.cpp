#include "server/archives/retention.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "server/archives/replicas.h"
#include "server/sessions/series.h"
#include "server/sessions/session_state.h"

namespace glasswing {
namespace {

bool is_captured(const v1::Session& session) {
  const v1::SessionState state = session.state();
  return (state == v1::SESSION_STATE_CAPTURED && !session.solve_follows()) || state == v1::SESSION_STATE_DONE;
}

bool is_exempt(const v1::Session& session, const RetentionRules& rules) {
  return session.kept() || session.plan().has_calibration() ||
         std::ranges::any_of(rules.exempt_tags, [&](const std::string& tag) {
           return std::ranges::count(session.tags(), tag) > 0;
         });
}

std::int64_t frame_bytes(const v1::Session& session) {
  return session.archive_bytes() * (1 + std::ranges::count_if(session.copies(), is_whole));
}

}  // namespace

std::vector<v1::SessionEnding> endings(const RetentionRules& rules, std::span<const StoredSession> sessions,
                                       absl::Time now) {
  std::vector<v1::SessionEnding> found;
  std::map<std::string, int> newer;  // sessions of each series
  for (const auto& [session, matte_bytes, solved] : sessions) {
    if (!is_captured(session)) continue;
    const std::string series = series_of(session);
    const int before = session.plan().has_calibration() ? 0 : newer[series]++;
    if (is_exempt(session, rules)) continue;
    v1::SessionEnding ending;
    ending.set_session(session.name());
    if (rules.newest > 0 && before >= rules.newest) {
      ending.set_bytes(frame_bytes(session) + matte_bytes);
      ending.set_why(
          fmt::format("series {} has {} newer sessions; {} are kept", series, before, rules.newest));
    } else if (rules.frames_days > 0.0 && session.state() == v1::SESSION_STATE_DONE &&
               !session.archive_address().empty() && session.frames_deleted().empty() &&
               now - solved >= absl::Hours(24.0 * rules.frames_days)) {
      ending.set_frames_only(true);
      ending.set_bytes(frame_bytes(session));
      ending.set_why(fmt::format("its matte is older than {} days", rules.frames_days));
    } else {
      continue;
    }
    found.push_back(std::move(ending));
  }
  return found;
}

}  // namespace glasswing
